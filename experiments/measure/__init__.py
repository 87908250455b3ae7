"""Measurements, one a figure of the paper; each writes a results file."""
