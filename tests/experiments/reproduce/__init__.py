"""Tests of experiments/reproduce."""
