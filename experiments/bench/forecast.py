"""Times a forecast beside the ranking of all orders, in turns, from Python and from C++; a part of `make bench`.

The traffic has some 2,000 feasible orders. A forecast finds the probabilities of them all, and predicts the 64 most
probable ones with their trajectories; the ranking predicts them all, without. Where there are more orders than a
planner's cycle has time for, a ranking ends by itself: that is timed too.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench.predictor import ROUNDS, in_turns
from experiments.bench.stopwatch import core_watch, spread
from experiments.bench.timed_traffic import crowd, traffic_with_orders
from experiments.show.predictor_speed import cycle_text
from intersection_env import Predictor, Traffic, forecast, rank_maneuvers
from intersection_env.maps.intersection import MAPS
from intersection_env.policies.named import DEFAULT, policy_path
from intersection_env.prediction.forecast import MOST

ROOT = Path(__file__).parents[2]
CORE, BUILD = ROOT / "intersection_env" / "core", ROOT / "build" / "cpp"
ORDERS = 2000
CALLS = 2000
MOST_OF_RANKING, MOST_TAIL = 0.15, 1.5
"""Bars: of the ranking's time, and of the 99 % quantile to the median."""


def forecast_times(quick: bool = False) -> dict[str, Any]:
    """Both, as the results file holds them; prints them on the way. `quick`: fewer rounds and calls."""
    rounds, calls = (3, CALLS // 20) if quick else (ROUNDS, CALLS)
    scene, orders = traffic_with_orders(ORDERS)
    results: dict[str, Any] = {"orders": orders, "vehicles": len(scene), "pairs": len(scene.conflicts)}
    results |= {"predicted": MOST, "policy": DEFAULT}
    results["python"] = python_times(scene, rounds, calls)
    results["cpp"] = cpp_times(scene, rounds, calls)
    for name in ("python", "cpp"):
        print(f"forecast of {MOST} of {orders} orders, {name}: {times_text(results[name])}")
    results["cycle"] = cycle_times(crowd(), rounds)
    print(cycle_text(results["cycle"]))
    return results


def times_text(row: dict[str, Any]) -> str:
    """One row in words."""
    if "missing" in row:
        return str(row["missing"])
    return (
        f"{row['forecast_ms']['median']:.2f} ms, {row['to_ranking']:.3f} of the ranking's"
        f" {row['ranking_ms']['median']:.1f} ms (at most {MOST_OF_RANKING}); p99 of {row['calls']} calls"
        f" {row['p99_to_median']:.2f} x their median (at most {MOST_TAIL})"
    )


def python_times(scene: Traffic, rounds: int, calls: int) -> dict[str, Any]:
    """`forecast` and `rank_maneuvers`, a table of pandas included."""
    predictor = Predictor.load(DEFAULT)

    def predicted() -> float:
        begin = time.perf_counter()
        assert len(forecast(predictor, scene, mass=1.0).orders) == MOST
        return 1e3 * (time.perf_counter() - begin)

    ranked = partial(_ranking_ms, predictor, scene)
    predicted(), ranked()  # loads pandas
    share = core_watch()
    found = in_turns({"forecast_ms": predicted, "ranking_ms": ranked}, rounds)
    row = summary(found["forecast_ms"], found["ranking_ms"], [predicted() for _ in range(calls)])
    return row | {"core_share": share()}


def cycle_times(scene: Traffic, rounds: int) -> dict[str, Any]:
    """`rank_maneuvers` of more orders than it predicts by default: what it takes, and how many those are."""
    predictor = Predictor.load(DEFAULT)
    orders = int(rank_maneuvers(predictor, scene).intervention.sum())
    ranked = partial(_ranking_ms, predictor, scene)
    return {"vehicles": len(scene), "orders": orders, "ranking_ms": in_turns({"ranked": ranked}, rounds)["ranked"]}


def _ranking_ms(predictor: Predictor, scene: Traffic) -> float:
    """What one ranking takes [ms]."""
    begin = time.perf_counter()
    rank_maneuvers(predictor, scene)
    return 1e3 * (time.perf_counter() - begin)


def summary(forecasts: dict[str, float], rankings: dict[str, float], calls: Sequence[float]) -> dict[str, Any]:
    """A row of the results: times in turns [ms], their ratio, and the tail of many calls of a forecast [ms]."""
    middle, tail = np.percentile(calls, (50.0, 99.0)).tolist()
    return {
        "forecast_ms": forecasts,
        "ranking_ms": rankings,
        "to_ranking": forecasts["median"] / rankings["median"],
        "p99_to_median": tail / middle,
        "calls": len(calls),
    }


def cpp_times(scene: Traffic, rounds: int, calls: int) -> dict[str, Any]:
    """`Planner::forecast` and `Planner::rank`, built anew where the core has changed; or why they are `missing`."""
    if None in (_tool("cmake"), _tool("ninja")):
        return {"missing": "cmake or ninja is not installed"}
    with tempfile.TemporaryDirectory() as folder:
        program = _built(Path(folder))
        (Path(folder) / "traffic.txt").write_text(_as_text(scene), encoding="utf-8")
        files = (MAPS / f"{scene.intersection.name}.map", policy_path(DEFAULT), Path(folder) / "traffic.txt")
        command = [str(program), *map(str, files), str(rounds), str(calls)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    return summary(spread(found["forecast_ms"]), spread(found["ranking_ms"]), found["calls_ms"])


def _built(folder: Path) -> Path:
    """The executable, against the core that is installed beside it."""
    _cmake("-S", CORE, "-B", BUILD, "-G", "Ninja", "-DINTERSECTION_ENV_PYTHON=OFF", "-DCMAKE_BUILD_TYPE=Release")
    _cmake("--build", BUILD)
    _cmake("--install", BUILD, "--prefix", folder / "prefix")
    shutil.copy(ROOT / "examples" / "planner" / "CMakeLists.txt", folder)
    shutil.copy(Path(__file__).with_name("planner.cpp"), folder)
    prefix = f"-DCMAKE_PREFIX_PATH={folder / 'prefix'}"
    _cmake("-S", folder, "-B", folder / "build", "-G", "Ninja", prefix, "-DCMAKE_BUILD_TYPE=Release")
    _cmake("--build", folder / "build")
    return folder / "build" / "planner"


def _tool(name: str) -> str | None:
    """Where a tool lies: beside this Python, or on the path."""
    return shutil.which(name, path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")


def _cmake(*arguments: str | Path) -> None:
    command = [str(_tool("cmake")), *map(str, arguments)]
    if "-G" in command:
        command.append(f"-DCMAKE_MAKE_PROGRAM={_tool('ninja')}")
    subprocess.run(command, capture_output=True, check=True)


def _as_text(scene: Traffic) -> str:
    """A vehicle a line: route, position, speed, length and width."""
    columns = zip(scene.route.tolist(), scene.position, scene.speed, scene.length, scene.width, strict=True)
    return "".join(
        f"{scene.intersection.routes[route].id} " + " ".join(f"{value:.9g}" for value in values) + "\n"
        for route, *values in columns
    )
