"""One moment of a world, as it is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import DT
from intersection_env.maps.intersection import Sample
from intersection_env.render.snapshot import Ghosts, Snapshot
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.replay import ReplayWorlds


def snapshot_of(worlds: ClosedLoopWorlds | ReplayWorlds, world: int = 0) -> Snapshot:
    """The present moment of one world."""
    if isinstance(worlds, ClosedLoopWorlds):
        return closed_loop_snapshot(worlds, world)
    return replay_snapshot(worlds, world)


def closed_loop_snapshot(worlds: ClosedLoopWorlds, world: int) -> Snapshot:
    """All vehicles of one world; who is held waits for those prioritized ones whose gap the policy refuses."""
    state = {name: values[world] for name, values in worlds.state().items()}
    vehicles = {name: state[name] for name in ("route", "position", "speed", "length", "width", "max_speed")}
    return Snapshot(
        **{name: vehicles[name] for name in ("route", "position", "speed", "length", "width")},
        v_max=_v_max(worlds, vehicles),
        enters=state["delta"],
        waits_for=_waits(worlds, vehicles, ~state["delta"]),
        time=float(state["cycle"]) * DT,
    )


def replay_snapshot(worlds: ReplayWorlds, world: int) -> Snapshot:
    """The acting vehicle of one world, its recorded self as a ghost, and the recorded others.

    Only the acting vehicle's gap decision is shown. By the recording, it waits for all whose way it has yet to cross.
    """
    state = {name: values[world] for name, values in worlds.state().items()}
    arrays, acting, time = worlds.tracks.arrays, int(state["track"]), int(state["time"])
    there = worlds.tracks.present(acting, time)
    recorded = np.array([worlds.tracks.recorded(track, time) for track in there.tolist()], np.float32).reshape(-1, 2)
    vehicles: dict[str, Any] = {
        "route": arrays["track_route"][there],
        "position": recorded[:, 0],
        "speed": recorded[:, 1],
        "length": arrays["track_length"][there],
        "width": arrays["track_width"][there],
        "max_speed": arrays["track_max_speed"][there],
    }
    is_acting = there == acting
    ghost = Ghosts(*(vehicles[name][is_acting] for name in ("route", "position", "length", "width")))
    for name in ("position", "speed"):
        vehicles[name] = np.where(is_acting, state[name], vehicles[name])
    held = is_acting & ~state["delta"]
    return Snapshot(
        **{name: vehicles[name] for name in ("route", "position", "speed", "length", "width")},
        v_max=_v_max(worlds, vehicles),
        enters=~held,
        waits_for=_waits(worlds, vehicles, held),
        ghosts=ghost,
        highlight=int(np.flatnonzero(is_acting)[0]),
        time=time * DT,
        caption=f"{worlds.tracks.track_id[acting]} in scene {worlds.tracks.scene_id[acting]}",
    )


def _v_max(worlds: ClosedLoopWorlds | ReplayWorlds, vehicles: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
    """What each vehicle may drive where it is: (vehicle,) [m/s]."""
    limits = worlds.intersection.sample_each(vehicles["route"], vehicles["position"])[:, Sample.V_MAX]
    return np.asarray(np.minimum(limits, vehicles["max_speed"]), np.float32)


def _waits(
    worlds: ClosedLoopWorlds | ReplayWorlds, vehicles: dict[str, NDArray[Any]], held: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """(pair, 2): one that is held, and a prioritized one whose gap is refused (all of them, by the recording)."""
    length = np.array([route.length for route in worlds.intersection.routes], np.float32)[vehicles["route"]]
    on_map = vehicles | {
        "position": np.clip(vehicles["position"], 0.0, length),
        "speed": np.maximum(vehicles["speed"], 0.0),  # who backs, decides as if standing
    }
    core_map = worlds.intersection.core
    traffic = _core.Traffic(core_map, *on_map.values())
    pairs = _core.conflicts(core_map, traffic)
    yielder, _ = pairs.T
    waits: NDArray[np.bool_] = held[yielder]
    if not (isinstance(worlds, ReplayWorlds) and worlds.is_recorded):
        _, _, accepts = _core.Predictor(core_map, worlds.policy).observe(traffic)
        waits = waits & ~accepts.view(np.bool_)
    return pairs[waits]
