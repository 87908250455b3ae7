"""The gap network: samples of recorded gaps, training, and the models it is compared with."""
