"""The state of worlds: taken, given back and gone on from, and refused where it is malformed."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from intersection_env import _core
from tests.support.recorded_windows import replayed_windows
from tests.support.world_traces import Worlds, act, bytes_of, trace
from tests.support.worlds_cases import closed_loop

VIEWS = {
    _core.ClosedLoop: ("observation",),
    _core.Replay: ("observation", "expert_observation", "expert_acceleration", "track", "time"),
}
KINDS = {
    "closed_loop": (partial(closed_loop, "bendplatz", 20, 6, max_cycles=90), 50, 100),
    "replay": (partial(replayed_windows, 20), 20, 60),
}


@pytest.mark.parametrize("through_pickle", [False, True])
@pytest.mark.parametrize("autoreset", ["off", "same_step", "next_step"])
@pytest.mark.parametrize(("make", "before", "after"), KINDS.values(), ids=KINDS)
def test_state_given_back_goes_on_to_the_same_bytes(
    make: Callable[..., Worlds], before: int, after: int, autoreset: str, through_pickle: bool
) -> None:
    one, other = (make(autoreset=autoreset) for _ in range(2))
    one.reset(5, True)
    trace(one, before, 1)
    state = one.state()
    assert not (autoreset == "same_step" and state["done"].any())
    other.reset(99, False)
    other.set_state(pickle.loads(pickle.dumps(state)) if through_pickle else state)
    assert bytes_of(other.state()) == bytes_of(state)
    for name in VIEWS[type(one)]:
        assert getattr(other, name).tobytes() == getattr(one, name).tobytes(), name
    assert trace(one, after, 6) == trace(other, after, 6)


def test_state_tells_the_acceleration_of_the_last_step() -> None:
    loop = closed_loop("t_junction", 5, 3)
    loop.reset(0, False)
    act(loop, np.random.default_rng(1), 0.3)
    stayed = ~loop.reinserted
    assert stayed.mean() > 0.8
    np.testing.assert_allclose(loop.state()["acceleration"][stayed], 6 * loop.action[stayed], atol=2e-5)


def test_state_is_a_copy() -> None:
    loop = closed_loop("t_junction", 2, 3)
    loop.reset(0, False)
    state = loop.state()
    before = bytes_of(loop.state())
    for values in state.values():
        values[:] = 1
    assert bytes_of(loop.state()) == before


@pytest.mark.parametrize("name", ["route", "speed", "random", "cycle"])
def test_malformed_states_are_refused(name: str) -> None:
    loop = closed_loop("t_junction", 2, 3)
    loop.reset(0, False)
    before = loop.state()
    for wrong in (before[name][:1].copy(), before[name].astype(np.float64)):
        with pytest.raises((ValueError, TypeError), match=f"{name}|a state's arrays"):
            loop.set_state({**before, name: wrong})
    with pytest.raises((ValueError, KeyError), match=name):
        loop.set_state({key: values for key, values in before.items() if key != name})
    assert bytes_of(loop.state()) == bytes_of(before)
