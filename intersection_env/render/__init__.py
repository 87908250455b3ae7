"""Frames of one moment with pygame."""
