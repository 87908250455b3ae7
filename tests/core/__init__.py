"""Tests of the core, and of the twin that judges it."""
