"""Recorded scenes: load, check, slice; those that ship."""
