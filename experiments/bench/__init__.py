"""How fast it is: predictor, environments and training, with their peers."""
