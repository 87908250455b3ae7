"""Recordings to scenes: inD's format, the SUMO stand-in, projection, filters, split."""
