"""Predictors that are no policies, to compare with."""
