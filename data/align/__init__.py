"""Moves a map's lanes to where recorded cars drive."""
