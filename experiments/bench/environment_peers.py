"""Times others' environments of an intersection, for the same run of `make bench`.

Each runs in a process of its own, `python -m experiments.bench.environment_peers NAME`.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from data.sumo import network as sumo_network
from data.sumo.command import command_of, dense_traffic
from experiments.bench.own_process import in_own_process, print_row
from experiments.bench.stopwatch import summary
from intersection_env.command import run_command
from intersection_env.constants import DT

REPEATS = 5
SECONDS = 0.6  # of a repetition
TWELVE_AGENTS = {
    "controlled_vehicles": 12,
    "initial_vehicle_count": 0,
    "spawn_probability": 0.0,
    "simulation_frequency": 5,
    "policy_frequency": 5,
}
"""HighwayEnv with our numbers: 12 agents, nobody else, steps of 0.2 s. By default it has 2 among 10 and takes 15 steps
of 1/15 s between two actions."""
VERSIONS = ("v0", "v1", "v2")  # of HighwayEnv 1.12.1
SUMO_WARM_UP, SUMO_STEPS = 120.0, 1000  # [s], steps of a repetition


def peer_rates() -> list[dict[str, Any]]:
    """A row a peer: name, unit, rate (median, least, best) and what it was doing; or why it is missing."""
    rows = []
    for name in PEERS:
        row = {"name": name} | in_own_process(__name__, name)
        said = row.get("missing") or f"{row['rate']['median']:,.0f} (best {row['rate']['best']:,.0f}) {row['unit']}"
        print(f"{name}: {said}", flush=True)
        rows.append(row)
    return rows


def highway_run(version: str, config: dict[str, Any]) -> dict[str, Any]:
    """HighwayEnv's intersection with random actions; resets count."""
    import gymnasium

    importlib.import_module("highway_env")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Gymnasium advises the newest version; all are timed
        env = gymnasium.make(f"intersection-multi-agent-{version}", config=config)
    env.action_space.seed(0)
    env.reset(seed=0)
    world: Any = env.unwrapped
    agents, rates, present = len(world.controlled_vehicles), [], []
    for _ in range(REPEATS):
        steps, begin = 0, time.perf_counter()
        while time.perf_counter() - begin < SECONDS:
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            present.append(len(world.road.vehicles))
            steps += 1
            if np.all(terminated) or np.any(truncated):
                env.reset()
        rates.append(agents * steps / (time.perf_counter() - begin))
    doing = f"{agents} agents among {np.mean(present):.1f} vehicles"
    return {"unit": "agent-steps/s", "rate": summary(rates), "doing": doing}


def libsumo_run() -> dict[str, Any]:
    """SUMO as a library on our Bendplatz: steps of 0.2 s, positions and speeds not read."""
    libsumo = importlib.import_module("libsumo")
    source, network = sumo_network.read()
    duration = SUMO_WARM_UP + (REPEATS + 1) * SUMO_STEPS * DT
    with tempfile.TemporaryDirectory() as folder:
        libsumo.start(command_of(network, dense_traffic(source, duration), Path(folder)))
        libsumo.simulationStep(SUMO_WARM_UP)
        rates, present = [], []
        for _ in range(REPEATS):
            count, begin = 0, time.perf_counter()
            for _ in range(SUMO_STEPS):
                libsumo.simulationStep()
                count += libsumo.vehicle.getIDCount()
            rates.append(count / (time.perf_counter() - begin))
            present.append(count / SUMO_STEPS)
        libsumo.close()
    doing = f"{np.mean(present):.1f} vehicles, no observations or rewards"
    return {"unit": "vehicle-steps/s", "rate": summary(rates), "doing": doing}


PEERS: dict[str, Callable[[], dict[str, Any]]] = {
    **{f"HighwayEnv intersection-multi-agent-{one}": partial(highway_run, one, {}) for one in VERSIONS},
    **{
        f"HighwayEnv intersection-multi-agent-{one}, our numbers": partial(highway_run, one, TWELVE_AGENTS)
        for one in VERSIONS
    },
    "libsumo on our Bendplatz": libsumo_run,
}


def main() -> None:
    """Times one peer and prints its row as JSON."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bench.environment_peers", description=__doc__)
    parser.add_argument("name", choices=PEERS)
    sys.exit(print_row(PEERS[parser.parse_args().name]))


if __name__ == "__main__":
    run_command(main)
