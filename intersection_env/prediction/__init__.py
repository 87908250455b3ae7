"""Traffic and priorities to predictions; crossing orders, enumerated and ranked."""
