"""Recordings to scenes: formats, the SUMO stand-in, projection, filters, split; maps of lanes to map sources."""
