"""Runs SUMO and takes down every vehicle's motion along its route.

SUMO runs as a program of its own: as a library in this process (libsumo 1.28) it crashed in about one
simulation of a hundred.

SUMO's vehicles do not pass each other within a lane, so overtaking is staged, once a recording: where a
car follows a bicycle into an exit arm with nobody oncoming, SUMO runs again with the bicycle's trip
ending there. The bicycle rides on at its speed, and whoever comes from behind passes it on the left.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import sumo

from data.sumo import net_file as sumo_net_file
from data.sumo import tracks as sumo_tracks
from data.sumo.demand import Driver
from data.sumo.demand import write as write_demand
from data.sumo.network import Network
from data.sumo.tracks import FRAME_RATE, Motion

ACTION_STEP = 0.32  # [s], ours: how often a driver decides; SUMO's waiting times depend on it
SETTINGS = (
    *("--step-length", str(1.0 / FRAME_RATE), "--default.action-step-length", str(ACTION_STEP)),
    *("--step-method.ballistic", "--time-to-teleport", "-1", "--time-to-impatience", "15"),
    *("--no-step-log", "--no-warnings"),
)
"""SUMO's, as the simulated recordings were driven."""
OVERTAKING_GAP = 4.0, 18.0  # [m], ours: between a bicycle and the car that will overtake it
OVERTAKING_AT = 1.0, 11.0  # [m], ours: how far beyond the junction the bicycle then is
LEAST_BICYCLE_SPEED = 3.0  # [m/s], ours: a slower one has just stopped and wobbles
CLEAR_AHEAD, CLEAR_ONCOMING = 18.0, 70.0  # [m], ours: nobody in front of the bicycle, nobody before the arm's stop line
CLEARED = 5.0  # [m], ours: this far beyond its stop line a vehicle no longer stands in the way
RIDE_ON = 20.0  # [s]


class State(NamedTuple):
    """A vehicle at one frame: how far its front is beyond its route's stop line, and beyond the junction [m]."""

    driver: Driver
    beyond_line: float
    beyond_junction: float


def simulate(
    network: Network, drivers: list[Driver], seed: int, warm_up: float, duration: float, overtaking_arms: set[str]
) -> list[Motion] | None:
    """Every vehicle's motion, frame 0 at the end of the warm-up; None if SUMO reports a collision.

    warm_up, duration: [s]; overtaking_arms: on whose exits a bicycle may be passed.
    """
    motions = _run(network, drivers, seed, warm_up, duration)
    if motions is None:
        return None
    found = _to_be_passed(network, motions, overtaking_arms)
    if found is None:
        return list(motions.values())
    bicycle, frame = found
    begin, scale = network.arcs[bicycle.driver.route, f"{network.route_edges[bicycle.driver.route][-1]}_0"]
    ends_at = (float(bicycle.front[frame - bicycle.first_frame]) - begin) / scale
    shorter = [replace(one, arrival=round(ends_at, 2)) if one is bicycle.driver else one for one in drivers]
    motions = _run(network, shorter, seed, warm_up, duration)
    if motions is None:
        return None
    _pass_bicycle(network, motions[bicycle.driver.id], list(motions.values()))
    return list(motions.values())


def _run(
    network: Network, drivers: list[Driver], seed: int, warm_up: float, duration: float
) -> dict[str, Motion] | None:
    by_id = {driver.id: driver for driver in drivers}
    with tempfile.TemporaryDirectory() as folder:
        positions, collisions = _call_sumo(network, drivers, seed, warm_up + duration, Path(folder))
        if "<collision " in collisions.read_text(encoding="utf-8"):
            return None
        rows = pd.read_csv(positions, sep=";", dtype={"vehicle_id": str}).dropna()
    motions = {}
    for one, mine in rows.groupby("vehicle_id", sort=False):
        driver = by_id[str(one)]
        arcs = np.array([network.arcs[driver.route, lane] for lane in mine.vehicle_lane])
        first = round((float(mine.timestep_time.iloc[0]) - warm_up) * FRAME_RATE)
        front = arcs[:, 0] + arcs[:, 1] * mine.vehicle_pos.to_numpy()
        speed = arcs[:, 1] * mine.vehicle_speed.to_numpy()
        motions[driver.id] = Motion(driver, first, front, speed, arcs[:, 1] * mine.vehicle_acceleration.to_numpy())
    return motions


def _call_sumo(network: Network, drivers: list[Driver], seed: int, end: float, folder: Path) -> tuple[Path, Path]:
    """Run SUMO; the files with every vehicle's position at every step, and with the collisions."""
    program = shutil.which("sumo", path=str(Path(sumo.SUMO_HOME) / "bin"))
    if program is None:
        raise FileNotFoundError(f"{sumo.SUMO_HOME}/bin: no program sumo; wanted the one of the package eclipse-sumo")
    net, demand, positions, collisions = (folder / name for name in ("a.net.xml", "a.rou.xml", "fcd.csv", "crash.xml"))
    sumo_net_file.write(network, net)
    write_demand(drivers, network.route_edges, demand)
    command = [
        *(program, "--net-file", str(net), "--route-files", str(demand), "--seed", str(seed), "--end", str(end)),
        *SETTINGS,
        *("--collision.check-junctions", "--collision.action", "warn", "--collision.mingap-factor", "0"),
        *("--fcd-output", str(positions), "--fcd-output.attributes", "id,lane,pos,speed,acceleration"),
        *("--collision-output", str(collisions), "--precision", "5"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"SUMO failed with exit status {done.returncode}: {done.stderr.strip()}")
    return positions, collisions


def _to_be_passed(network: Network, motions: dict[str, Motion], arms: set[str]) -> tuple[Motion, int] | None:
    """The first bicycle that the car behind it may pass, nobody being oncoming, and the frame when."""
    found: list[tuple[int, str]] = []
    for bicycle in motions.values():
        beyond = bicycle.front - network.paths[bicycle.driver.route].junction_end
        if bicycle.driver.kind != "bicycle" or _exit(bicycle.driver) not in arms:
            continue
        there = (beyond >= OVERTAKING_AT[0]) & (beyond <= OVERTAKING_AT[1]) & (bicycle.speed >= LEAST_BICYCLE_SPEED)
        for frame in bicycle.first_frame + np.flatnonzero(there)[::5]:
            if frame > 0 and _may_be_passed(bicycle.driver, _states(network, motions, int(frame))):
                found.append((int(frame), bicycle.driver.id))
                break
    if not found:
        return None
    frame, passed = min(found)
    return motions[passed], frame


def _states(network: Network, motions: dict[str, Motion], frame: int) -> list[State]:
    states = []
    for one in motions.values():
        if 0 <= frame - one.first_frame < len(one.front):
            front, path = float(one.front[frame - one.first_frame]), network.paths[one.driver.route]
            states.append(State(one.driver, front - path.stop_line, front - path.junction_end))
    return states


def _may_be_passed(bicycle: Driver, states: list[State]) -> bool:
    """Whether someone follows at the right distance, nobody is just in front and nobody oncoming."""
    arm = _exit(bicycle)
    at = next(one.beyond_junction for one in states if one.driver.id == bicycle.id)
    others = [one for one in states if one.driver.id != bicycle.id and _exit(one.driver) == arm]
    near = [one for one in others if one.beyond_junction - one.driver.length < at + CLEAR_AHEAD]
    gaps = [at - bicycle.length - one.beyond_junction for one in near]
    oncoming = any(
        one.driver.route.startswith(f"{arm}-") and -CLEAR_ONCOMING < one.beyond_line < CLEARED + one.driver.length
        for one in states
    )
    return not oncoming and bool(gaps) and OVERTAKING_GAP[0] <= min(gaps) <= OVERTAKING_GAP[1]


def _pass_bicycle(network: Network, bicycle: Motion, motions: list[Motion]) -> None:
    """Let the bicycle ride on, and everyone who follows it into its exit arm pass it on the left."""
    last = bicycle.first_frame + len(bicycle.front) - 1
    at = float(bicycle.front[-1])
    sumo_tracks.ride_on(bicycle, RIDE_ON)
    end = network.paths[bicycle.driver.route].junction_end
    for motion in motions:
        shift = end - network.paths[motion.driver.route].junction_end
        index = last - motion.first_frame
        was_ahead = 0 <= index < len(motion.front) and motion.front[index] + shift > at
        if motion is not bicycle and _exit(motion.driver) == _exit(bicycle.driver) and not was_ahead:
            sumo_tracks.swerve(motion, bicycle, shift, last)


def _exit(driver: Driver) -> str:
    return driver.route.partition("-")[2]
