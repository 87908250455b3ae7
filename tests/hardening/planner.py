"""The C++ example planner beside Python: the same traffic, the same ranking, the same most probable orders.

`python -m tests.hardening.planner PREFIX COMMAND...` compares what the command (an emulator, valgrind, the example)
prints; PREFIX is where the core was installed. `make harden` runs it with sanitizers, under valgrind and for ARM64.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from intersection_env import Intersection, Predictor, Traffic, Vehicle, forecast, rank_maneuvers
from tests.conftest import MAP_NAMES
from tests.support.paths import ROOT
from tests.support.twins import random_case

TRAFFIC = ROOT / "examples" / "planner" / "traffic.txt"
NUMBERS = ["total_time_loss", "worst_time_loss", "gain", "minimum_distance"]
FLAGS = ["followed", "safe", "worth_executing"]
TOLERANCE = 1e-3  # [s], [m]
CHANCE_TOLERANCE = 1e-2  # [%]
MASS = 95.0  # [%], of which the orders are predicted
RANDOM = 6  # random traffics a map


def read_traffic(path: Path, name: str = "bendplatz") -> Traffic:
    """The example's traffic file: id, route, position, speed, length and width a line."""
    rows = [line.split() for line in path.read_text().splitlines()]
    return Traffic.of(Intersection.load(name), [Vehicle(row[0], row[1], *map(float, row[2:])) for row in rows])


def write_traffic(traffic: Traffic, path: Path) -> None:
    """The same file from a traffic whose vehicles have no top speed of their own."""
    fields = (traffic.position, traffic.speed, traffic.length, traffic.width)
    with path.open("w") as file:
        for i, vehicle_id in enumerate(traffic.ids):
            numbers = " ".join(f"{field[i]:.9g}" for field in fields)
            file.write(f"{vehicle_id} {traffic.intersection.routes[traffic.route[i]].id} {numbers}\n")


def random_traffic(name: str, seed: int) -> Traffic:
    """A random traffic of a shipped map that such a file can hold."""
    case, _ = random_case(name, 70_000 + seed)
    return Traffic(case.intersection, case.ids, case.route, case.position, case.speed, case.length, case.width)


def printed(command: Sequence[str], prefix: Path, path: Path, name: str = "bendplatz") -> pd.DataFrame:
    """The ranking that the example prints; in `attrs["probable"]` the chances of the most probable orders [%]."""
    share = prefix / "share" / "intersection_env"
    files = [share / "maps" / f"{name}.map", share / "policies" / "gap.policy", path]
    done = subprocess.run([*command, *map(str, files), "100000"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"exit status {done.returncode}: {done.stdout[-2000:]}{done.stderr[-8000:]}")
    lines = done.stdout.splitlines()
    last = next(k for k, line in enumerate(lines) if "orders left out" in line)
    rows = [line.split(maxsplit=7) for line in lines[1:last]]
    table = pd.DataFrame(rows, columns=[*NUMBERS, *FLAGS, "order"])
    table[NUMBERS] = table[NUMBERS].astype(float)
    for flag in FLAGS:
        table[flag] = table[flag] == "yes"
    assert lines[last].startswith(f"{len(table)} maneuvers, ")
    table.attrs["left_out"] = int(lines[last].split()[2])
    begin = next(k for k, line in enumerate(lines) if line.startswith("the most probable of "))
    table.attrs["feasible"] = int(lines[begin].split()[4])
    chances = (line.split(maxsplit=2) for line in lines[begin + 1 :])
    table.attrs["probable"] = {order: float(chance) for chance, _, order in chances}
    return table


def assert_same(cpp: pd.DataFrame, python: pd.DataFrame) -> None:
    """The same maneuvers in the same order, numbers within the tolerance; neighbours that near may change places."""
    assert cpp.attrs["left_out"] == python.attrs["left_out"]
    assert sorted(cpp.order) == sorted(python.order)
    np.testing.assert_allclose(cpp.total_time_loss, python.total_time_loss, atol=TOLERANCE)
    by_order = python.set_index("order").loc[cpp.order]
    np.testing.assert_allclose(cpp[NUMBERS], by_order[NUMBERS], atol=TOLERANCE)
    for flag in FLAGS:
        assert (cpp[flag].to_numpy() == by_order[flag].to_numpy()).all()


def assert_same_forecast(cpp: pd.DataFrame, traffic: Traffic) -> None:
    """The same three most probable orders, chances within what is printed; orders that near may change places."""
    python = forecast(Predictor.load("gap"), traffic, mass=1.0)
    chances = 100.0 * python.probability
    by_order = dict(zip(python.words(), chances.tolist(), strict=True))
    probable = cpp.attrs["probable"]
    assert cpp.attrs["feasible"] == python.feasible
    assert len(probable) == min(3, len(chances)) or sum(probable.values()) > MASS
    np.testing.assert_allclose(list(probable.values()), chances[: len(probable)], atol=CHANCE_TOLERANCE)
    for order, chance in probable.items():
        assert abs(by_order[order] - chance) < CHANCE_TOLERANCE, order


def main() -> int:
    """Compares the example's own traffic, and random ones on both maps."""
    prefix, command = Path(sys.argv[1]), sys.argv[2:]
    cases = [read_traffic(TRAFFIC), *(random_traffic(name, seed) for name in MAP_NAMES for seed in range(RANDOM))]
    maneuvers = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "traffic.txt"
        for traffic in cases:
            write_traffic(traffic, path)
            cpp = printed(command, prefix, path, traffic.intersection.name)
            assert_same(cpp, rank_maneuvers(Predictor.load("gap"), traffic))
            assert_same_forecast(cpp, traffic)
            maneuvers += len(cpp)
    print(f"{' '.join(command)}: {len(cases)} rankings and forecasts, {maneuvers} maneuvers, all as Python's")
    return 0


if __name__ == "__main__":
    sys.exit(main())
