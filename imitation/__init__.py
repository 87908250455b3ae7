"""Generative adversarial imitation learning (GAIL): the driver learns to drive like the recorded ones."""
