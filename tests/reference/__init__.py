"""The twin: the model and the worlds in NumPy, slow, obvious, in float64; it imports nothing of the package."""
