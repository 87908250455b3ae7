"""Tests of experiments/measure."""
