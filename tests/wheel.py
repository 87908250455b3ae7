"""Tries the installed wheel from an empty folder; not collected by pytest (`.ci/run` runs it).

The wheel alone must do a planner's job: no checkout, no torch, no SUMO, no matplotlib.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import intersection_env
from intersection_env import Intersection, Predictor, Traffic, Vehicle, rank_maneuvers


def main() -> None:
    """Ranks the crossing orders of three vehicles on each shipped map."""
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
    print(f"the wheel works: {intersection_env._core.kernel_name()} kernel")


if __name__ == "__main__":
    main()
