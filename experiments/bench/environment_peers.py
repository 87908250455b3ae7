"""Times others' environments of an intersection, for the same run of `make bench`.

Each runs in a process of its own, `python -m experiments.bench.environment_peers NAME`: libsumo crashes now and then,
and HighwayEnv registers environments. A peer that is not installed or fails is reported so, and the bench goes on.
"""

from __future__ import annotations

import argparse
import importlib
import json
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from data.sumo import demand as sumo_demand
from data.sumo import net_file as sumo_net_file
from data.sumo import network as sumo_network
from experiments.bench.stopwatch import summary
from intersection_env.constants import DT
from intersection_env.maps.source import MapSource

MAP = Path(__file__).parents[2] / "intersection_env" / "maps" / "bendplatz.json"
REPEATS = 5
SECONDS = 0.6  # of a repetition
MOST_SECONDS = 180  # of a peer
NOT_INSTALLED = 3  # exit status
TWELVE_AGENTS = {
    "controlled_vehicles": 12,
    "initial_vehicle_count": 0,
    "spawn_probability": 0.0,
    "simulation_frequency": 5,
    "policy_frequency": 5,
}
"""HighwayEnv with our numbers: 12 agents, nobody else, steps of 0.2 s. By default it has 2 among 10 and takes 15 steps
of 1/15 s between two actions."""
SUMO_WARM_UP, SUMO_STEPS = 120.0, 1000  # [s], steps of a repetition
SUMO_DEMAND = 1.7  # ours: times the demand of the shipped recordings, for about 12 vehicles at a time


def peer_rates() -> list[dict[str, Any]]:
    """A row a peer: name, unit, rate (median, least, best) and what it was doing; or why it is missing."""
    rows = []
    for name in PEERS:
        row = {"name": name} | in_own_process("experiments.bench.environment_peers", name)
        said = row.get("missing") or f"{row['rate']['median']:,.0f} (best {row['rate']['best']:,.0f}) {row['unit']}"
        print(f"{name}: {said}", flush=True)
        rows.append(row)
    return rows


def in_own_process(module: str, name: str) -> dict[str, Any]:
    """What `python -m MODULE NAME` prints last, as JSON; or why it is `missing`."""
    command = [sys.executable, "-W", "ignore", "-m", module, name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=MOST_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return {"missing": f"not done after {MOST_SECONDS} s"}
    if done.returncode == NOT_INSTALLED:
        return {"missing": "not installed"}
    if done.returncode:
        return {"missing": f"failed with exit status {done.returncode}"}
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def highway_run(version: str, config: dict[str, Any]) -> dict[str, Any]:
    """HighwayEnv's intersection with random actions; resets count."""
    import gymnasium

    importlib.import_module("highway_env")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # there is a v2, not a multi-agent one to compare with
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
    source = MapSource.read(MAP)
    duration = SUMO_WARM_UP + (REPEATS + 1) * SUMO_STEPS * DT
    with tempfile.TemporaryDirectory() as folder:
        libsumo.start(sumo_files(source, drivers(source, duration), Path(folder)))
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


def keep_present(state: Path) -> None:
    """Leaves in the state who is on a lane, and their types; SUMO saves the next 200 s' vehicles and all types too."""
    tree = ElementTree.parse(state)
    root = tree.getroot()
    present = {one for on_lane in root.iter("vehicles") for one in on_lane.get("value", "").split()}
    for vehicle in root.findall("vehicle"):
        if vehicle.get("id") not in present:
            root.remove(vehicle)
    types = {vehicle.get("type") for vehicle in root.findall("vehicle")}
    for kind in root.findall("vType"):
        if kind.get("id") not in types:
            root.remove(kind)
    tree.write(state)


def sumo_files(source: MapSource, demand: list[sumo_demand.Driver], folder: Path) -> list[str]:
    """Writes Bendplatz and these drivers for SUMO; returns the command that simulates them."""
    network = sumo_network.build(source, MAP.with_suffix(".map").read_text(encoding="utf-8"))
    net, routes = folder / "a.net.xml", folder / "a.rou.xml"
    sumo_net_file.write(network, net)
    sumo_demand.write(demand, network.route_edges, routes)
    command = ["sumo", "-n", str(net), "-r", str(routes), "--step-length", str(DT), "--no-step-log"]
    return [*command, "--no-warnings", "--time-to-teleport", "-1", "--seed", "1"]


def drivers(source: MapSource, duration: float) -> list[sumo_demand.Driver]:
    """The demand of the shipped recordings, denser: drawn over a longer time, which is then shortened."""
    rng = np.random.default_rng(0)
    main_arms = {arm for arm, value in source.arms.items() if value.right_of_way == "priority"}
    streams = [
        sumo_demand.Stream(one.id, one.entry, "main" if one.entry in main_arms else "side", source.turn(one))
        for one in source.routes
    ]
    drawn = sumo_demand.draw_drivers(rng, streams, duration * SUMO_DEMAND)
    return [replace(one, depart=one.depart / SUMO_DEMAND) for one in drawn if one.kind != "bicycle"]


PEERS: dict[str, Callable[[], dict[str, Any]]] = {
    "HighwayEnv intersection-multi-agent-v0": lambda: highway_run("v0", {}),
    "HighwayEnv intersection-multi-agent-v1": lambda: highway_run("v1", {}),
    "HighwayEnv intersection-multi-agent-v0, our numbers": lambda: highway_run("v0", TWELVE_AGENTS),
    "HighwayEnv intersection-multi-agent-v1, our numbers": lambda: highway_run("v1", TWELVE_AGENTS),
    "libsumo on our Bendplatz": libsumo_run,
}


def main() -> None:
    """Times one peer and prints its row as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=PEERS)
    try:
        row = PEERS[parser.parse_args().name]()
    except ModuleNotFoundError as error:
        print(error, file=sys.stderr)
        sys.exit(NOT_INSTALLED)
    print(json.dumps(row))


if __name__ == "__main__":
    main()
