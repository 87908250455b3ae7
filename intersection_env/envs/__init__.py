"""The two environments: closed loop (PettingZoo) and replay (Gymnasium)."""
