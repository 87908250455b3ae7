"""Rollouts inside the core are what stepping the worlds from outside gives."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from tests.support.recorded_windows import DECISIONS, replayed_windows
from tests.support.rollout_cases import check_rollouts
from tests.support.world_traces import Worlds
from tests.support.worlds_cases import closed_loop


@pytest.mark.parametrize(
    "make",
    [
        *(
            pytest.param(partial(closed_loop, "bendplatz", 40, count, max_cycles=100), id=f"closed_loop-{count}")
            for count in (5, 8)
        ),
        *(pytest.param(partial(replayed_windows, 40, decisions=name), id=f"replay-{name}") for name in DECISIONS),
    ],
)
def test_rollout_is_what_stepping_gives(make: Callable[..., Worlds]) -> None:
    rolling, stepping = (make(autoreset="same_step", threads=threads) for threads in (2, 1))
    rolling.reset(3, True)
    stepping.reset(4, False)
    met = check_rollouts(rolling, stepping, 40)
    assert min(met.values()) > 1e-3
