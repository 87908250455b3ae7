"""Pictures with matplotlib: maps, predictions, animations."""
