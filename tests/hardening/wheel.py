"""Tries the installed wheel from an empty folder; not collected by pytest (`.ci/run` runs it).

The wheel alone must do a planner's and a learner's job: no checkout, no torch, no SUMO, no matplotlib, no pygame.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pettingzoo

import intersection_env
from intersection_env import Intersection, Predictor, Scenes, Traffic, Vehicle, rank_maneuvers
from intersection_env.viewer.page_files import page_files


def main() -> None:
    """Ranks the crossing orders of three vehicles on each shipped map, and steps every environment."""
    installed = Path(intersection_env.__file__).resolve()
    assert Path(sys.prefix).resolve() in installed.parents, f"not the wheel: {installed}"
    for name in ("data", "agents", "imitation", "experiments", "tests"):
        assert importlib.util.find_spec(name) is None, f"the wheel installs a package named {name}"
    assert not list(installed.parent.rglob("*.cpp")), "the wheel ships C++ sources"
    for name, routes in {"bendplatz": ("NE-SW", "SE-NW", "NW-SE"), "t_junction": ("S-W", "W-E", "E-W")}.items():
        intersection = Intersection.load(name)
        stop_line = [intersection.routes[intersection.route_index(route)].stop_line for route in routes]
        vehicles = [Vehicle(route, route, line - 15.0, 6.0) for route, line in zip(routes, stop_line, strict=True)]
        table = rank_maneuvers(Predictor.load("idm"), Traffic.of(intersection, vehicles))
        assert len(table) == 5, table
        assert table.total_time_loss.notna().all()
    assert {"index.html", "style.css", "main.js"} <= set(page_files()), "the wheel lacks the viewer's page"
    step_environments()
    print(f"the wheel works: {intersection_env._core.kernel_name()} kernel")


def step_environments() -> None:
    """A few steps through each door, with the scenes that ship."""
    assert len(Scenes.load("bendplatz").select("train")) > 0
    replay = gymnasium.make("intersection_env/Replay-v0")
    replay.reset(seed=1)
    replay.step(np.zeros(1, np.float32))
    replays = gymnasium.make_vec("intersection_env/Replay-v0", num_envs=8)
    replays.reset(seed=1)
    replays.step(np.zeros((8, 1), np.float32))
    loop = pettingzoo.make("parallel", "intersection_env/ClosedLoop-v0", gap="gap")
    loop.reset(seed=1)
    loop.step({agent: np.zeros(1, np.float32) for agent in loop.agents})


if __name__ == "__main__":
    main()
