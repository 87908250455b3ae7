"""Tests of pictures and frames."""
