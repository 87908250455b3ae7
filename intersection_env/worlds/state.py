"""States of worlds that come from outside, checked before the core is given them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def check_state(state: Mapping[str, NDArray[Any]], like: Mapping[str, NDArray[Any]], max_cycles: int | None) -> None:
    """Refuses what is no state of worlds whose state is now `like`; the ranges of the traffic are for the core.

    Raises:
        TypeError: no dict of arrays, or an array of another type.
        ValueError: an array is missing, unknown or of another shape, or a value is impossible; the message names it.
    """
    if not isinstance(state, Mapping):
        raise TypeError(f"a state must be a dict from name to array, not {type(state).__name__}")
    for name in state:
        if name not in like:
            raise ValueError(f'a state has no array "{name}"; wanted {", ".join(like)}')
    for name, wanted in like.items():
        if name not in state:
            raise ValueError(f'the array "{name}" of the state is missing')
        values = state[name]
        if not isinstance(values, np.ndarray) or values.dtype != wanted.dtype:
            came = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
            raise TypeError(f'the array "{name}" of the state is {came}; wanted {wanted.dtype}')
        if values.shape != wanted.shape:
            raise ValueError(f'the array "{name}" of the state has shape {values.shape}; wanted {wanted.shape}')
    if max_cycles is not None:
        cycle = state["cycle"]
        _refuse("cycle", (cycle < 0) | (cycle > max_cycles), cycle, f"0 to {max_cycles}")
    # A generator whose numbers are all 0 gives nothing but 0.
    is_zero: NDArray[np.bool_] = np.all(state["random"] == 0, axis=1)
    _refuse("random", is_zero, state["random"], "a row that is not 0 throughout")


def _refuse(name: str, wrong: NDArray[np.bool_], values: NDArray[Any], wanted: str) -> None:
    if wrong.any():
        world = int(np.argmax(wrong))
        raise ValueError(f'the array "{name}" of the state, world {world}: {values[world]!s}; wanted {wanted}')
