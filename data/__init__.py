"""Recordings to scenes: formats, simulation with SUMO, projection, filters, split; maps of lanes to map sources."""
