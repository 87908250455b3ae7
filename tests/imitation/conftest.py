"""Torch on one thread, from one seed."""

from tests.support.networks import one_thread as one_thread
