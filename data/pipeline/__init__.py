"""From recordings to scenes: projection, extrapolation, filters, split."""
