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

from imitation.adjoint import Error, Motion, effects_of_accelerations, error_by_motion
from imitation.examples import LEAST_STEPS, Example
from imitation.expert import expert_steps
from imitation.map_tables import MapTables
from imitation.torch_networks import Networks, View
from intersection_env.constants import DT, FREE_LEAD_SPEED, LEAD_RANGE, STEPS
from intersection_env.features import Driving
from intersection_env.scenes.scenes import Scenes

NO_LEAD = 1e6  # [m]


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
        """Where the driver gets to in the first so many steps: (step, row).

        noise: (step, row, 12), added to what the driver sees; None: nothing.
        """
        position, speed = self.position[:, 0], self.speed[:, 0]
        motion: list[tuple[Tensor, Tensor, Tensor]] = []
        for step in range(steps):
            own = None if noise is None else noise[step]
            acceleration = self._accelerations(tables, networks, step, position, speed, own)
            faster = (speed + DT * acceleration).clamp(min=0.0)
            position, applied = position + 0.5 * DT * (speed + faster), (faster - speed) / DT
            speed = faster
            motion.append((position, speed, applied))
        return Motion(*(torch.stack(one) for one in zip(*motion, strict=True)))

    def backward(
        self, tables: MapTables, networks: Networks, steps: int, error: Error, noise: Tensor | None = None
    ) -> float:
        """Adds the gradients of an error of `driven` to the weights of the driver, and returns the error.

        They are those that torch finds through the steps one by one, in half of the time.
        """
        with torch.no_grad():
            motion = self.driven(tables, networks, steps, noise)
        value, of = error_by_motion(motion, error)
        started = (torch.cat([one[:, :1].T, after[:-1]]) for one, after in zip(self[2:4], motion, strict=False))
        position, speed = (one.requires_grad_(True) for one in started)
        acceleration = self._accelerations(tables, networks, slice(steps), position, speed, noise)
        slopes = torch.autograd.grad(acceleration.sum(), [position, speed], retain_graph=True)
        with torch.no_grad():
            takes_effect = speed + DT * acceleration >= 0.0
            effects = effects_of_accelerations(of, takes_effect, slopes, torch.ones_like(takes_effect), None)
        (effects * acceleration).sum().backward()  # type: ignore[no-untyped-call]
        return value

    def _accelerations(
        self,
        tables: MapTables,
        networks: Networks,
        steps: int | slice,
        position: Tensor,
        speed: Tensor,
        noise: Tensor | None,
    ) -> Tensor:
        """Of one step (row,), or of some at once (step, row) [m/s²]."""
        lead_rear, lead_speed, delta = (one.T[steps] for one in (self.lead_rear, self.lead_speed, self.delta))
        v_max, headings = tables.road(self.route.expand(position.shape), position)
        front = position + self.half_length
        gap = lead_rear - front
        near = gap <= LEAD_RANGE
        view = View(
            tables.stop_line[self.route] - front,
            speed,
            v_max,
            headings,
            gap.clamp(max=LEAD_RANGE),
            torch.where(near, lead_speed, FREE_LEAD_SPEED),
        )
        return networks.drive(view, delta, noise)


def recorded_drives(tables: MapTables, places: Sequence[Scenes], split: str, every: float) -> Drives:
    """One of every recorded car and truck of a split every so many seconds.

    Raises:
        ValueError: as of `ReplayWorlds`.
    """
    columns: list[Drives] = []
    for place in places:
        steps = expert_steps(place, split)
        seen, half = steps.observation, steps.half_length
        route = steps.route + tables.begin[place.intersection.checksum]
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
    return joined(*columns)


def _starts(track: NDArray[np.int32], apart: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where drives begin among the steps of all tracks, and how many steps each may last, the first one included."""
    begins = np.flatnonzero(np.diff(track, prepend=-1))
    ends = np.append(begins[1:], len(track))
    first = np.concatenate(
        [np.arange(begin, end - LEAST_STEPS, apart) for begin, end in zip(begins, ends, strict=True)]
    )
    left = ends[np.searchsorted(begins, first, side="right") - 1] - first
    return first, np.minimum(left, STEPS + 1)


def free_drives(tables: MapTables, examples: Sequence[Example]) -> Drives:
    """Of cars that are alone in their examples."""
    traffics = [one.traffic for one in examples]
    route = [tables.begin[one.intersection.checksum] + int(one.route[0]) for one in traffics]
    position, speed = (
        torch.from_numpy(np.stack([getattr(one, name)[:, 0] for one in examples])) for name in ("position", "speed")
    )
    known = torch.from_numpy(np.stack([one.scored[:, 0] for one in examples]))
    return Drives(
        torch.tensor(route),
        torch.tensor([0.5 * float(one.length[0]) for one in traffics]),
        position,
        speed,
        torch.full_like(position, NO_LEAD),
        torch.full_like(position, FREE_LEAD_SPEED),
        torch.ones_like(known),
        known,
    )


def joined(*parts: Drives) -> Drives:
    """One after the other."""
    return Drives(*(torch.cat(one) for one in zip(*parts, strict=True)))
