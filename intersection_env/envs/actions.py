"""Actions at the border: checked once, before the core trusts them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

Array = NDArray[np.float32]
NUMPY = {np.ndarray}


def check_actions(actions: object, shape: tuple[int, ...]) -> Array:
    """The actions, if they are what the core may be given.

    Raises:
        gymnasium.error.InvalidAction: no float32 array of this shape, or a value that is no number in [-1, 1].
    """
    array = _as_array(actions)
    if array is None or array.dtype != np.float32:
        came = type(actions).__name__ if array is None else array.dtype
        raise InvalidAction(f"the action must be an array of float32, not {came}")
    if array.shape != shape:
        raise InvalidAction(f"the action must have shape {shape}, not {array.shape}")
    if not np.abs(array).max() <= 1.0:  # so written, NaN is refused too
        wrong = array[~(np.abs(array) <= 1.0)][0]
        raise InvalidAction(f"the action holds {wrong}; wanted numbers in [-1, 1] (times 6 m/s²)")
    return array


def read_actions(actions: Mapping[str, Array], agents: Sequence[str], buffer: Array) -> None:
    """Writes the action of each agent into the buffer (agent,), with few calls where all is well.

    Raises:
        gymnasium.error.InvalidAction: an agent without an action, an unknown one, or an action that is no float32
            array of shape (1,) in [-1, 1]; the message names the agent.
    """
    try:
        values = list(map(actions.__getitem__, agents))
        is_well = len(actions) == len(values) and all(map(len, values)) and set(map(type, values)) == NUMPY
        np.concatenate(values, out=buffer, casting="no")  # none is empty and all fit: each is one number
    except (TypeError, ValueError, KeyError, AttributeError, RuntimeError):
        is_well = False
    if not is_well:
        _read_one_by_one(actions, agents, buffer)
        return
    for value in buffer.tolist():
        if not -1.0 <= value <= 1.0:
            _read_one_by_one(actions, agents, buffer)


def _as_array(actions: object) -> NDArray[Any] | None:
    """An array of any library as NumPy's, or None if it is none or out of NumPy's reach, as on a GPU."""
    if not hasattr(actions, "__array__"):
        return None
    try:
        return np.asarray(actions)
    except (TypeError, ValueError, RuntimeError):
        return None


def _read_one_by_one(actions: object, agents: Sequence[str], buffer: Array) -> None:
    if not isinstance(actions, Mapping):
        raise InvalidAction(f"actions must be a dict from agent to action, not {type(actions).__name__}")
    missing = [agent for agent in agents if agent not in actions]
    unknown = [agent for agent in actions if agent not in agents]
    if missing or unknown:
        which = f"no action for {', '.join(missing)}" if missing else f"unknown agent {unknown[0]!r}"
        raise InvalidAction(f"{which}; wanted one action for each of {agents[0]} to {agents[-1]}")
    for slot, agent in enumerate(agents):
        try:
            buffer[slot] = check_actions(actions[agent], (1,))[0]
        except InvalidAction as error:
            raise InvalidAction(f"{agent}: {error}") from None
