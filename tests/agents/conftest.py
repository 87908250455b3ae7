"""Torch on one thread, from one seed; Ray with two cores."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from agents.training.ray import LOCAL_RAY
from tests.support.networks import one_thread as one_thread


@pytest.fixture(scope="module")
def ray_with_two_cores() -> Iterator[None]:
    import ray

    ray.init("local", num_cpus=2, **LOCAL_RAY)
    yield
    ray.shutdown()
