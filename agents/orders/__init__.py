"""Training of what forecasts need: the probability of each pair's order, and the spread of the drivers."""
