"""The soak itself, for a second; `make harden` runs it for minutes."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env.features import Driving
from tests.hardening import soak


def test_random_actions_leave_everything_finite_on_its_route_and_within_the_spaces() -> None:
    soak.run(200_000, 20_000, worlds=64, threads=1)


def test_predictions_leave_memory_as_it_is() -> None:
    soak.predict(20_000, batch=64)


@pytest.mark.parametrize("kind", ["closed_loop", "replay"])
def test_the_soak_sees_what_is_wrong(kind: str) -> None:
    one = soak.closed_loop("bendplatz", "critical_gap", 80, 1) if kind == "closed_loop" else soak.replay(80, 1)
    one.step()
    one.worlds.reward[1] = np.inf
    with pytest.raises(AssertionError, match="reward"):
        one.check_results()
    one.worlds.reward[1] = 0.0
    for wrong in (np.nan, 1e4):
        one.worlds.observation[2, ..., Driving.SPEED] = wrong
        with pytest.raises(AssertionError, match="observation leaves"):
            one.check_results()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(one, "length", one.length * 0.01)
        with pytest.raises(AssertionError, match="off the route"):
            one.check_state()
        patched.undo()
        patched.setattr(one, "high", one.high * 0.0)
        with pytest.raises(AssertionError, match="speeds from"):
            one.check_state()


def test_the_soak_sees_memory_grow() -> None:
    kept: list[bytes] = []

    def leaking(worlds: int) -> soak.Soak:
        one = soak.replay(worlds, 1)
        check = one.check_results
        one.check_results = lambda: (check(), kept.append(b"x" * 2**23))[0]  # type: ignore[method-assign, func-returns-value]
        return one

    with pytest.raises(AssertionError, match="memory grew"):
        soak.soak(leaking, 64 * 40, 64, "leak")
