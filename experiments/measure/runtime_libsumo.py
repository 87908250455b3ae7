"""Times libsumo from 2 to 15 vehicles, for the runtime figure, in a process of its own: it crashes now and then.

python -m experiments.measure.runtime_libsumo
"""

from __future__ import annotations

import importlib
import tempfile
import time
from pathlib import Path
from typing import Any

from data.sumo import network as sumo_network
from data.sumo.command import command_of, dense_traffic, keep_present, without_drivers
from experiments.bench.own_process import print_row
from experiments.bench.predictor import SIZES
from experiments.bench.predictor_peers import SEARCHED
from experiments.bench.stopwatch import core_watch
from experiments.measure.timed_calls import Times, garbage_kept, model_row
from intersection_env import _core
from intersection_env.command import run_command
from intersection_env.constants import DT

SUMO_STATES, SUMO_SPACING, SUMO_REPEATS = 20, 2.0, 3  # a number of vehicles; [s] of one number's, at least; of each


def libsumo_times() -> dict[str, Any]:
    """50 steps of 0.2 s from states of libsumo's own traffic: restoring included, and the steps alone."""
    libsumo = importlib.import_module("libsumo")
    source, network = sumo_network.read()
    core_share = core_watch()
    whole: Times = {size: [] for size in SIZES}
    alone: Times = {size: [] for size in SIZES}
    with tempfile.TemporaryDirectory() as folder, garbage_kept():
        command = command_of(network, dense_traffic(source, SEARCHED), Path(folder))
        states = _libsumo_states(libsumo, command, Path(folder))
        libsumo.start(without_drivers(command))
        for size, state in states * SUMO_REPEATS:
            started = time.perf_counter()
            libsumo.simulation.loadState(state)
            restored = time.perf_counter()
            for _ in range(_core.STEPS):
                libsumo.simulationStep()
            done = time.perf_counter()
            whole[size].append(1e3 * (done - started))
            alone[size].append(1e3 * (done - restored))
        libsumo.close()
    share = core_share()
    doing = f"{SUMO_REPEATS} times each of up to {SUMO_STATES} states; {_core.STEPS} steps of {DT} s"
    whole_row = model_row(whole, f"{doing}, restoring included") | {"core_share": share}
    return {"libsumo": whole_row, "libsumo, steps alone": model_row(alone, doing) | {"core_share": share}}


def _libsumo_states(libsumo: Any, command: list[str], folder: Path) -> list[tuple[int, str]]:
    """States of its traffic, saved: how many vehicles, and the file."""
    saved: list[tuple[int, str]] = []
    times: Times = {size: [] for size in SIZES}
    libsumo.start(command)
    while (now := libsumo.simulation.getTime()) < SEARCHED:
        libsumo.simulationStep()
        of_size = times.get(libsumo.vehicle.getIDCount())
        if of_size is None or len(of_size) == SUMO_STATES or (of_size and now - of_size[-1] < SUMO_SPACING):
            continue
        of_size.append(now)
        saved.append((libsumo.vehicle.getIDCount(), str(folder / f"{len(saved)}.xml")))
        libsumo.simulation.saveState(saved[-1][1])
        keep_present(Path(saved[-1][1]))
    libsumo.close()
    return saved


def main() -> int:
    """Prints its times as JSON; returns the exit status."""
    return print_row(libsumo_times)


if __name__ == "__main__":
    run_command(main)
