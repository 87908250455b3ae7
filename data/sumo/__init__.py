"""The simulated recordings that ship, and how they are made."""
