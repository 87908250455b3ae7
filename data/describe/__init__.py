"""What recordings are like: gaps, speeds, standing times."""
