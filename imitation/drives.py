"""Drives of one vehicle from which gradients flow: through 10 s among recorded others, or alone on the road.

The driver's own state is simulated; its lead and its gap decision at each step are what the recorded vehicle in its
place had. So no pair and no other vehicle is evaluated, and a thousand drives take a fraction of a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from imitation.expert import expert_steps
from imitation.map_tables import MapTables
from imitation.torch_networks import Networks, View
from imitation.tracks import replays
from intersection_env.constants import DT, FREE_LEAD_SPEED, LEAD_RANGE, STEPS
from intersection_env.features import Driving
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic, Vehicle

LEAST_STEPS = 5  # a drive that is known for less than 1 s says nothing
NO_LEAD = 1e6  # [m]
FREE_LENGTH = 4.5  # [m], of the cars that drive alone


class Motion(NamedTuple):
    """What a rollout did in its steps: (row, step) each, or (row, step, vehicle) [m], [m/s], [m/s²]."""

    position: Tensor
    speed: Tensor
    acceleration: Tensor


class Drives(NamedTuple):
    """Recorded drives, a row each, at the start and after each of up to 50 steps.

    route: (row,) places in the tables. half_length: (row,) [m]. position, speed: (row, time) [m], [m/s]. lead_rear,
    lead_speed: (row, time) the rear bumper of the lead on the same route [m], `NO_LEAD` without one, and its speed
    [m/s]. delta: (row, time) bool. known: (row, time) bool, whether the drive has lasted till then.
    """

    route: Tensor
    half_length: Tensor
    position: Tensor
    speed: Tensor
    lead_rear: Tensor
    lead_speed: Tensor
    delta: Tensor
    known: Tensor

    def rows(self, chosen: Tensor) -> Drives:
        """Some of the drives."""
        return Drives(*(one[chosen] for one in self))

    def driven(self, tables: MapTables, networks: Networks, steps: int, noise: Tensor | None = None) -> Motion:
        """Where the driver gets to in the first so many steps.

        noise: (step, row, 12), added to what the driver sees; None: nothing.
        """
        position, speed = self.position[:, 0], self.speed[:, 0]
        to_line = tables.stop_line[self.route] - self.half_length
        motion: list[tuple[Tensor, Tensor, Tensor]] = []
        for step in range(steps):
            v_max, headings = tables.road(self.route, position)
            gap = self.lead_rear[:, step] - position - self.half_length
            near = gap <= LEAD_RANGE
            lead_speed = torch.where(near, self.lead_speed[:, step], FREE_LEAD_SPEED)
            view = View(to_line - position, speed, v_max, headings, gap.clamp(max=LEAD_RANGE), lead_speed)
            acceleration = networks.drive(view, self.delta[:, step], None if noise is None else noise[step])
            faster = (speed + DT * acceleration).clamp(min=0.0)
            position, applied = position + 0.5 * DT * (speed + faster), (faster - speed) / DT
            speed = faster
            motion.append((position, speed, applied))
        return Motion(*(torch.stack(one, 1) for one in zip(*motion, strict=True)))


def recorded_drives(tables: MapTables, places: Sequence[Scenes], split: str, every: float) -> Drives:
    """One of every recorded car and truck of a split every so many seconds.

    Raises:
        ValueError: as of `ReplayWorlds`.
    """
    columns: list[Drives] = []
    for place in places:
        steps, tracks = expert_steps(place, split), replays(place, split).tracks.arrays
        seen = steps.observation
        route = tracks["track_route"][steps.track] + tables.begin[place.intersection.checksum]
        half = 0.5 * tracks["track_length"][steps.track]
        front = tables.stop_line.numpy()[route] - seen[:, Driving.DISTANCE_TO_STOP_LINE]
        leads = seen[:, Driving.LEAD_SPEED] < FREE_LEAD_SPEED
        rear = np.where(leads, front + seen[:, Driving.LEAD_DISTANCE], NO_LEAD)
        first, length = _starts(steps.track, round(every / DT))
        rows = np.minimum(first[:, None] + np.arange(STEPS + 1), (first + length - 1)[:, None])
        motion = (front - half, seen[:, Driving.SPEED], rear, seen[:, Driving.LEAD_SPEED])
        of_drive = (torch.from_numpy(route[first].astype(np.int64)), torch.from_numpy(half[first].astype(np.float32)))
        at_steps = (torch.from_numpy(one.astype(np.float32)[rows]) for one in motion)
        delta = torch.from_numpy(seen[:, Driving.ENTERS][rows] > 0.0)
        known = torch.from_numpy(np.arange(STEPS + 1) < length[:, None])
        columns.append(Drives._make((*of_drive, *at_steps, delta, known)))
    return Drives(*(torch.cat(one) for one in zip(*columns, strict=True)))


def _starts(track: NDArray[np.int32], apart: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where drives begin among the steps of all tracks, and how many steps each may last, the first one included."""
    begins = np.flatnonzero(np.diff(track, prepend=-1))
    ends = np.append(begins[1:], len(track))
    first = np.concatenate(
        [np.arange(begin, end - LEAST_STEPS, apart) for begin, end in zip(begins, ends, strict=True)]
    )
    left = ends[np.searchsorted(begins, first, side="right") - 1] - first
    return first, np.minimum(left, STEPS + 1)


def free_drives(
    tables: MapTables, maps: Sequence[Intersection], teacher: Predictor, count: int, generator: np.random.Generator
) -> Drives:
    """Drives of a car alone, as a teacher drives them, from random places of random routes.

    Nobody is recorded beyond the view, nor, at many a speed, on an empty road: there this says what to do. One in five
    begins at a standstill, the others at up to the allowed speed.
    """
    found: list[tuple[int, NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]] = []
    while len(found) < count:
        intersection = maps[int(generator.integers(len(maps)))]
        route = intersection.routes[int(generator.integers(len(intersection.routes)))]
        place = float(generator.uniform(0.0, route.length))
        allowed = float(intersection.sample(route.index, np.array([place], np.float32))[0, Sample.V_MAX])
        speed = allowed * max(float(generator.uniform(-0.25, 1.0)), 0.0)
        alone = Vehicle("alone", route.id, place, speed, FREE_LENGTH)
        drive = teacher.predict(Traffic.of(intersection, [alone]))
        known = drive.present[0, :, 0]
        if known.sum() > LEAST_STEPS:
            begin = tables.begin[intersection.checksum]
            found.append((begin + route.index, drive.position[0, :, 0], drive.speed[0, :, 0], known))
    route_rows, *motions = zip(*found, strict=True)
    position, speeds, known_rows = (torch.from_numpy(np.stack(one)) for one in motions)
    return Drives(
        torch.tensor(route_rows),
        torch.full((count,), 0.5 * FREE_LENGTH),
        position,
        speeds,
        torch.full_like(position, NO_LEAD),
        torch.full_like(position, FREE_LEAD_SPEED),
        torch.ones_like(known_rows),
        known_rows,
    )
