"""Tests of the batched worlds against the twin."""
