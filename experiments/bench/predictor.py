"""Times the predictor beside the floor that the machine's own arithmetic sets it; a part of `make bench`.

Everything in a table is timed in turns, several rounds, so that a machine that slows down slows all of it alike. The
floor comes from the same rounds: the networks' multiply-adds and tanh at the best rates the core's lanes reached.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Hashable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from experiments.bench.predictor_flips import flip_rates
from experiments.bench.predictor_peers import predictor_peer_times
from experiments.bench.stopwatch import core_watch, spread
from experiments.bench.timed_traffic import arithmetic, both_networks, rules, traffic, traffic_with_orders
from intersection_env import Predictor, Traffic, _core, rank_maneuvers

Key = TypeVar("Key", bound=Hashable)
Spread = dict[str, float]
ROUNDS = 9
SECONDS = 0.004  # of one timing, at least
BATCHES = (64, 1024)
SIZES = range(2, 16)
CYCLE = 0.2  # [s], a planner's
LATENCY_CALLS = 100_000
ORDERS = (100, 2000)
FLIPPED = 2000  # traffics
DISTANCES = ", with distances"
TOGETHER = "assigned, together"
TOLD = "assigned", TOGETHER


def predictor_times(quick: bool = False) -> dict[str, Any]:
    """Everything, as the results file holds it; prints it on the way. `quick`: a third of the rounds, fewer calls."""
    rounds = max(1, ROUNDS // 3) if quick else ROUNDS
    scene = traffic()
    results: dict[str, Any] = {"vehicles": len(scene), "pairs": len(scene.conflicts), "steps": _core.STEPS}
    works: dict[Hashable, Callable[[], float]] = {}
    for isa in _core.available_kernels():  # its arithmetic right beside its cases
        works |= {(what, isa): _arithmetic(what, isa) for what in ("fma", "tanh")}
        works |= {(isa, row, n): _case(scene, isa, row, n) for row, n in _rows()}
    core_share = core_watch()
    found = in_turns(works, rounds)
    results["core_share"] = core_share()
    results |= _floors(found) | _times(found)
    _print(results)
    results |= _on_all_cores(scene, rounds)
    results["vehicles_us"] = _by_vehicles(results["peaks"], max(1, rounds // 3))
    results["latency_us"] = latency(scene, LATENCY_CALLS // (50 if quick else 1))
    results["ranking_ms"] = ranking(rounds)
    results["flips"] = flip_rates(FLIPPED // (10 if quick else 1))
    results["peers_us"] = predictor_peer_times()
    return results


def in_turns(works: Mapping[Key, Callable[[], float]], rounds: int) -> dict[Key, Spread]:
    """What each work says it took, over rounds in which each has its turn: median, most and best (least)."""
    taken: dict[Key, list[float]] = {key: [] for key in works}
    for _ in range(rounds):
        for key, work in works.items():
            taken[key].append(work())
    return {key: spread(values) for key, values in taken.items()}


def _arithmetic(what: str, isa: str) -> Callable[[], float]:
    """Seconds a multiply-add or tanh, by the same measure as the predictor's times: the median of many calls."""
    yardstick, rounds = (_core.multiply_adds, 100_000) if what == "fma" else (_core.tanhs, 10_000)

    def work() -> float:
        times: list[float] = []
        count = 1
        while sum(times) < SECONDS:
            begin = time.perf_counter()
            count, _ = yardstick(isa, rounds)
            times.append(time.perf_counter() - begin)
        return float(np.median(times)) / count

    return work


def _rows() -> list[tuple[str, int]]:
    """What is timed for each instruction set: which driver, with smallest distances or not, how many scenarios."""
    names = [driver + beside for driver in ("networks", "idm", "assigned", TOGETHER) for beside in ("", DISTANCES)]
    return [(name, n) for name in names for n in (1, *BATCHES)]


def _case(scene: Traffic, isa: str, row: str, scenarios: int, threads: int = 1) -> Callable[[], float]:
    """Microseconds a scenario, summaries only; each by itself, but for crossing orders together."""
    driver = row.removesuffix(DISTANCES)
    policy = rules() if driver == "idm" else both_networks()
    predictor = _core.Predictor(scene.intersection.core, _core.Policy(policy.text(), driver), threads)
    assignments = np.zeros((scenarios, len(scene.conflicts)), np.int8)
    if driver in TOLD:
        assignments = _orders(scene, scenarios)
    safety, apart = row.endswith(DISTANCES), driver != TOGETHER
    return lambda: _microseconds(lambda: predictor.summarize(scene.core, assignments, safety, isa, apart), scenarios)


def _orders(scene: Traffic, scenarios: int) -> NDArray[np.int8]:
    """Crossing orders that say who goes first for every pair, one a scenario."""
    cooperative, first = np.ones(len(scene), np.uint8), np.full(len(scene.conflicts), -1, np.int8)
    found = _core.Orders(scene.intersection.core, scene.core, cooperative, first).next(scenarios)
    assert len(found) == scenarios
    assert found.all()
    return found


def _microseconds(work: Callable[[], object], scenarios: int) -> float:
    """The time of one of the scenarios that one call of `work` predicts: the median call's."""
    work()
    times: list[float] = []
    while sum(times) < SECONDS:
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return float(np.median(times)) / scenarios * 1e6


def _floors(found: Mapping[Any, Spread]) -> dict[str, Any]:
    rates = {
        isa: {f"{name}_per_s": 1.0 / found[what, isa]["best"] for what, name in (("fma", "fmas"), ("tanh", "tanhs"))}
        for isa in _core.available_kernels()
    }
    scene = traffic()
    counts = {"floor_us": len(scene.conflicts), "assigned_floor_us": 0}
    floors = {name: {isa: floor(rates[isa], len(scene), n) for isa in rates} for name, n in counts.items()}
    return {"peaks": rates} | floors


def floor(rates: Spread, vehicles: int, pairs: int) -> float:
    """What the networks of one scenario take at these rates [µs], had everybody to be asked at every step."""
    multiply_adds, tanhs = arithmetic(both_networks(), vehicles, pairs)
    return 1e6 * (multiply_adds / rates["fmas_per_s"] + tanhs / rates["tanhs_per_s"])


def _times(found: Mapping[Any, Spread]) -> dict[str, Any]:
    kernels = _core.available_kernels()
    free = [name for name, n in _rows() if n == 1 and not name.startswith("assigned")]
    told = [name for name, n in _rows() if n == 1 and name.startswith("assigned")]
    batch = {isa: {row: {str(n): found[isa, row, n] for n in BATCHES} for row in free} for isa in kernels}
    assigned = {isa: {row: {str(n): found[isa, row, n] for n in (1, *BATCHES)} for row in told} for isa in kernels}
    cycle = {
        isa: {
            row: int(CYCLE * 1e6 / one[str(BATCHES[-1])]["median"]) for row, one in (batch[isa] | assigned[isa]).items()
        }
        for isa in kernels
    }
    alone = {isa: {row: found[isa, row, 1] for row in free} for isa in kernels}
    return {"single_us": alone, "batch_us": batch, "assigned_us": assigned, "maneuvers_per_cycle": cycle}


def _on_all_cores(scene: Traffic, rounds: int) -> dict[str, Any]:
    """The times of the largest batch shared among threads, one a core."""
    kernels, most = _core.available_kernels(), BATCHES[-1]
    rows = ("networks", "networks" + DISTANCES)
    found = in_turns({(isa, row): _case(scene, isa, row, most, threads=0) for isa in kernels for row in rows}, rounds)
    print(f"\n{most} scenarios on {os.cpu_count()} cores")
    for isa in kernels:
        print(f"{isa}: " + ", ".join(f"{row} {found[isa, row]['median']:.1f}" for row in rows))
    times = {isa: {row: {str(most): found[isa, row]} for row in rows} for isa in kernels}
    return {"cores": os.cpu_count(), "threads_us": times}


def _by_vehicles(rates: dict[str, Spread], rounds: int) -> dict[str, Any]:
    """By instruction set and number of vehicles: pairs, floor, and the times of 1, 64 and 1024 scenarios."""
    scenes = {size: traffic(size) for size in SIZES}
    kernels, counts = _core.available_kernels(), (1, *BATCHES)
    cases = {
        (isa, size, n): _case(scene, isa, "networks", n)
        for isa in kernels
        for size, scene in scenes.items()
        for n in counts
    }
    found = in_turns(cases, rounds)
    times: dict[str, Any] = {isa: {} for isa in kernels}
    for isa in kernels:
        print(f"\n{isa}: vehicles (pairs): floor, best of {', '.join(str(n) for n in counts)} scenarios [µs each]")
        for size, scene in scenes.items():
            pairs = len(scene.conflicts)
            least = floor(rates[isa], size, pairs)
            times[isa][str(size)] = {"pairs": pairs, "floor": least} | {str(n): found[isa, size, n] for n in counts}
            print(f"{size:4} ({pairs}): {least:6.1f}" + "".join(f"{found[isa, size, n]['best']:8.1f}" for n in counts))
    return times


def latency(scene: Traffic, most: int) -> dict[str, Spread]:
    """Percentiles of one call that predicts one scenario, by the best kernel, from Python [µs]."""
    core = _core.Predictor(scene.intersection.core, _core.Policy(both_networks().text(), "networks"))
    assignment = np.zeros((1, len(scene.conflicts)), np.int8)
    latencies = {}
    for row, safety, calls in (("networks", False, most), ("networks" + DISTANCES, True, most // 10)):
        taken = np.zeros(calls, np.int64)
        for k in range(calls):
            begin = time.perf_counter_ns()
            core.summarize(scene.core, assignment, safety)
            taken[k] = time.perf_counter_ns() - begin
        percentiles = np.percentile(taken, (50.0, 99.0, 99.9)) / 1e3
        latencies[row] = dict(zip(("p50", "p99", "p99.9"), percentiles.tolist(), strict=True)) | {"calls": calls}
        print(f"latency of one scenario, {row}: p50 {percentiles[0]:.1f}, p99 {percentiles[1]:.1f}", end="")
        print(f", p99.9 {percentiles[2]:.1f} µs over {calls} calls")
    return latencies


def ranking(rounds: int) -> dict[str, Any]:
    """What `rank_maneuvers` takes [ms], a table of pandas included, by how many orders are wanted and by policy."""
    predictors = {"networks": Predictor(both_networks(), "networks"), "gap": Predictor.load("gap")}
    scenes = {wanted: traffic_with_orders(wanted) for wanted in ORDERS}

    def work(wanted: int, name: str) -> float:
        scene, orders = scenes[wanted]
        begin = time.perf_counter()
        assert len(rank_maneuvers(predictors[name], scene)) == orders + 1
        return 1e3 * (time.perf_counter() - begin)

    rank_maneuvers(predictors["gap"], scenes[ORDERS[0]][0])  # loads pandas
    keys = [(wanted, name) for wanted in ORDERS for name in predictors]
    found = in_turns({key: lambda key=key: work(*key) for key in keys}, rounds)  # type: ignore[misc]
    times: dict[str, Any] = {}
    for wanted in ORDERS:
        scene, orders = scenes[wanted]
        rows = {name: found[wanted, name] for name in predictors}
        times[str(wanted)] = {"orders": orders, "vehicles": len(scene), "pairs": len(scene.conflicts)} | rows
        said = ", ".join(f"{name} {row['median']:.1f} (best {row['best']:.1f})" for name, row in rows.items())
        print(f"rank_maneuvers, {orders} orders of {len(scene)} vehicles [ms]: {said}")
    return times


def _print(results: dict[str, Any]) -> None:
    print(f"{results['vehicles']} vehicles, {results['pairs']} open pairs, {results['steps']} steps; µs a scenario")
    for isa, peaks in results["peaks"].items():
        rates = ", ".join(f"{value / 1e9:.2f} G {name.removesuffix('_per_s')}/s" for name, value in peaks.items())
        print(
            f"\n{isa}: {rates}; floor {results['floor_us'][isa]:.1f}, assigned {results['assigned_floor_us'][isa]:.1f}"
        )
        rows = {row: {"1": one} | results["batch_us"][isa][row] for row, one in results["single_us"][isa].items()}
        for row, times in (rows | results["assigned_us"][isa]).items():
            cells = "".join(f"{times[n]['median']:10.1f} ({times[n]['best']:6.1f})" for n in times)
            print(f"{row:36}{cells}")
