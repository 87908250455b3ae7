"""Batched worlds: many simulated intersections, stepped at once by the core."""
