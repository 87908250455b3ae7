"""Intersections: map sources, their compilation, the compiled map."""
