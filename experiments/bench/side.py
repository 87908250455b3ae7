"""One side of `against.py`: times a row with the revision of `intersection_env` that this process imports.

`main` answers each line of its input with one timing, as JSON; its first answer is a greeting. It imports nothing of
this project but the package, and of that only what 9b4ae97 has too. Networks and vehicles are given, so that both sides
are asked for the same; maps, scenes and policy files are each revision's own.
"""

from __future__ import annotations

import hashlib
import json
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from intersection_env import (
    ClosedLoopWorlds,
    Intersection,
    Predictor,
    ReplayWorlds,
    Traffic,
    Vehicle,
    _core,
    rank_maneuvers,
)

_policies = import_module(
    "intersection_env.policies.file" if find_spec("intersection_env.constants") else "intersection_env.policy"
)  # which it was before the package had rooms
NetworkWeights, PolicyFile = _policies.NetworkWeights, _policies.PolicyFile
Given = dict[str, Any]
Work = Callable[[], object]
SECONDS = 0.05  # of one timing, at least
ROLLOUT_STEPS, SIGMA, VEHICLES = 32, 0.1, 12
WARM_UP = 150  # steps of worlds, until they have forgotten how they started
ACCELERATION = 6.0  # [m/s²] at an action of 1
DRIVERS = ("networks", "assigned", "idm")  # assigned: networks that are told every pair's order
MEMORY = "memory"  # rows that begin so are asked once
CLOSED_LOOP, RECORDING = "closed loop", "recording"  # which worlds; other replays ask the gap network
SAME_WORLDS, SAME_ROLLOUTS = 100, 10
TRAJECTORIES = 7  # arrays: positions, speeds, accelerations, who enters, who is present, time losses, distances
SAME = "same trajectories"  # likewise; they answer with a hash


def answer(given: Given, row: str) -> Callable[[], Any]:
    """What a row asks for each time: seconds a unit; bytes; or a hash.

    Raises:
        ValueError: no such row.
    """
    what, *arguments = row.split(", ")
    settings = dict(one.split(" ", 1) for one in arguments)
    known: dict[str, Callable[..., Callable[[], Any]]] = {
        "predict": _predict,
        "rank": _rank,
        CLOSED_LOOP: _closed_loop,
        "replay": _replay,
        MEMORY: _memory,
        SAME: _same,
    }
    if what not in known:
        raise ValueError(f'no row begins with "{what}"; wanted {", ".join(known)}')
    return known[what](given, **settings)


def _predict(
    given: Given, driver: str, n: str, isa: str, distances: str = "no", together: str = "no"
) -> Callable[[], Any]:
    """A scenario of a batch, summaries only: each by itself; or together, where a revision knows how to."""
    scene, count = _traffic(given["vehicles"]), int(n)
    if driver not in DRIVERS:
        raise ValueError(f'no driver "{driver}"; wanted {", ".join(DRIVERS)}')
    policy = PolicyFile("critical_gap", "idm") if driver == "idm" else _policy(given)
    predictor = _core.Predictor(scene.intersection.core, _core.Policy(policy.text(), driver))
    assignments = np.zeros((count, len(scene.conflicts)), np.int8)
    if driver == "assigned":
        cooperative, first = np.ones(len(scene), np.uint8), np.full(len(scene.conflicts), -1, np.int8)
        assignments = _core.Orders(scene.intersection.core, scene.core, cooperative, first).next(count)
        assert len(assignments) == count
    if hasattr(predictor, "summarize"):
        knows_how = "apart" in (predictor.summarize.__doc__ or "")
        how = {"apart": True} if knows_how and together == "no" else {}
        return _seconds(lambda: predictor.summarize(scene.core, assignments, distances == "yes", isa, **how), count)
    return _seconds(lambda: predictor.predict(scene.core, assignments, False, distances == "yes", None, isa), count)


def _rank(given: Given, orders: str) -> Callable[[], Any]:
    """All crossing orders of a traffic that has about so many, a table included."""
    scene, predictor = _traffic(given[f"vehicles_{orders}"]), Predictor(_policy(given), "networks")
    return _seconds(lambda: rank_maneuvers(predictor, scene, limit=None), 1)


def _closed_loop(given: Given, worlds: str, isa: str, threads: str = "1") -> Callable[[], Any]:
    """A step of a vehicle in a rollout: gap, policy and value networks and sampling inside."""
    return _rollout(given, _worlds(given, CLOSED_LOOP, int(worlds), isa, int(threads)))


def _replay(given: Given, worlds: str, isa: str, threads: str = "1", gap: str = "network") -> Callable[[], Any]:
    """A step of a replay: in a rollout with networks inside; or, with recorded gaps, as the recorded vehicle drove."""
    made = _worlds(given, gap, int(worlds), isa, int(threads))
    if gap != RECORDING:
        return _rollout(given, made)
    made.reset(0, desynchronise=True)

    def steps() -> None:
        """Some, by the recorded vehicles' actions."""
        for _ in range(ROLLOUT_STEPS):
            np.clip(made.expert_acceleration / ACCELERATION, -1.0, 1.0, out=made.action)
            made.step()

    return _seconds(steps, ROLLOUT_STEPS * len(made.action))


def _worlds(
    given: Given, of: str, count: int, isa: str | None = None, threads: int = 1, split: str | None = "train"
) -> Any:
    """Worlds in a closed loop, or replays; gaps are decided by the network that is given, or as they were recorded."""
    with tempfile.TemporaryDirectory() as folder:
        gap = RECORDING if of == RECORDING else _gap_policy(given, folder)
        if of == CLOSED_LOOP:
            return ClosedLoopWorlds(worlds=count, vehicles=VEHICLES, gap=gap, threads=threads, isa=isa)
        return ReplayWorlds(split=split, worlds=count, gap=gap, threads=threads, isa=isa)


def _rollout(given: Given, worlds: ClosedLoopWorlds | ReplayWorlds) -> Callable[[], Any]:
    arrays = _arrays(worlds)
    worlds.reset(0, desynchronise=True)

    def run() -> None:
        """One rollout."""
        worlds.core.rollout(given["policy"], given["value"], SIGMA, ROLLOUT_STEPS, *arrays)

    for _ in range(0, WARM_UP, ROLLOUT_STEPS):
        run()
    return _seconds(run, arrays[-1].size)


def _arrays(worlds: ClosedLoopWorlds | ReplayWorlds) -> list[np.ndarray[Any, Any]]:
    """Where a rollout puts what it finds: observations, five numbers and two flags an agent-step."""
    count, *vehicles = worlds.action.shape
    shape = (count, ROLLOUT_STEPS, *vehicles)
    numbers = [np.zeros((*shape, 12), np.float32), *(np.zeros(shape, np.float32) for _ in range(5))]
    return numbers + [np.zeros(shape, np.bool_) for _ in range(2)]


def _memory(given: Given, of: str) -> Callable[[], Any]:
    """Resident bytes more than before, once worlds have stepped."""

    def used() -> int:
        """By making them, and a step."""
        before = _resident()
        made = _worlds(given, of, 4096 if of == CLOSED_LOOP else 1024, split=None)
        made.reset(0)
        made.step()
        return _resident() - before

    return used


def _same(given: Given, isa: str, of: str = "predictions") -> Callable[[], Any]:
    """A hash of many traffics' trajectories; or of what worlds gave in a rollout."""
    if of == "predictions":
        return partial(_hash_of_predictions, given, isa)
    return partial(_hash_of_rollouts, given, _worlds(given, of, SAME_WORLDS, isa))


def _hash_of_rollouts(given: Given, worlds: ClosedLoopWorlds | ReplayWorlds) -> str:
    arrays = _arrays(worlds)
    worlds.reset(0, desynchronise=True)
    for _ in range(SAME_ROLLOUTS):
        worlds.core.rollout(given["policy"], given["value"], SIGMA, ROLLOUT_STEPS, *arrays)
    return hashlib.sha256(b"".join(one.tobytes() for one in arrays)).hexdigest()


def _hash_of_predictions(given: Given, isa: str) -> str:
    found = hashlib.sha256()
    policy = _core.Policy(_policy(given).text(), "networks")
    for vehicles in given["random"]:
        try:
            scene = _traffic(vehicles)
        except ValueError as error:  # a revision may refuse it
            found.update(str(error).encode())
            continue
        predictor = _core.Predictor(scene.intersection.core, policy)
        assignments = np.zeros((1, len(scene.conflicts)), np.int8)
        arrays = predictor.predict(scene.core, assignments, True, True, None, isa)[:TRAJECTORIES]
        found.update(b"".join(np.asarray(one).tobytes() for one in arrays))
    return found.hexdigest()


def _seconds(work: Work, units: int) -> Callable[[], float]:
    """Seconds a unit, of which each call of `work` does so many: the median call's."""
    work()

    def timing() -> float:
        """One, of as many calls as it takes."""
        times: list[float] = []
        while sum(times) < SECONDS:
            begin = time.perf_counter()
            work()
            times.append(time.perf_counter() - begin)
        return float(np.median(times)) / units

    return timing


def _resident() -> int:
    """Bytes of this process, by Linux."""
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * resource.getpagesize()


def _traffic(vehicles: list[tuple[str, float, float]]) -> Traffic:
    bendplatz = Intersection.load("bendplatz")
    return Traffic.of(bendplatz, [Vehicle(str(k), *one) for k, one in enumerate(vehicles)])


def _policy(given: Given) -> Any:
    return PolicyFile("network", "network", _network(given, "gap"), _network(given, "driving"))


def _gap_policy(given: Given, folder: str) -> Path:
    """A file with the gap network that is given; the IDM beside it drives nobody here."""
    path = Path(folder) / "given.policy"
    PolicyFile("network", "idm", _network(given, "gap")).save(path)
    return path


def _network(given: Given, name: str) -> Any:
    shift, scale, *layers = given[name]
    return NetworkWeights(shift, scale, list(zip(layers[::2], layers[1::2], strict=True)))


def read(path: Path) -> Given:
    """What `against.py` has written: arrays by name, lists of them under NAME/0, NAME/1, ..., the rest as JSON."""
    given: Given = {}
    with np.load(path) as file:
        given |= json.loads(str(file["vehicles"]))
        for name in file.files:
            of, _, _ = name.partition("/")
            if of != name:
                given.setdefault(of, []).append(file[name])
            elif name != "vehicles":
                given[name] = file[name]
    return given


def main(path: str, row: str) -> None:
    """Answers until its input ends."""
    ask = answer(read(Path(path)), row)
    print(json.dumps("ready"), flush=True)
    for _ in sys.stdin:
        print(json.dumps(ask()), flush=True)
