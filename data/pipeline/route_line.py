"""A route's centreline, onto which recorded points are projected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import XY, Intersection, Route, Sample

BEND = 1.0  # [m], ours: a bend is measured over as much before and behind
MOST_STRETCH = 2.0  # ours: near the centre of a bend the nearest place leaps

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RouteLine:
    """A route's centreline, ready for projecting many points onto it."""

    intersection: Intersection
    route: Route

    def locate(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Arc length, distance and excess of the nearest place on the route, per point (point, 2) [m].

        The excess is the distance less what a lane wider than 3.5 m leaves free.
        """
        return self.intersection.core.project(self.route.index, np.ascontiguousarray(points, dtype=np.float64))

    def width(self, position: Floats) -> Floats:
        """The lane's width at the given arc lengths [m]."""
        return self._samples(position)[:, Sample.WIDTH].astype(np.float64)

    def direction(self, position: Floats) -> Floats:
        """(position, 2): the unit vector along the route."""
        heading = self._samples(position)[:, Sample.HEADING].astype(np.float64)
        return np.stack([np.cos(heading), np.sin(heading)], axis=1)

    def left(self, position: Floats, points: NDArray[np.float64]) -> Floats:
        """How far points lie to the left of the route's places at these arc lengths: (position,) [m].

        points: (position, 2) [m].
        """
        here = self._samples(position).astype(np.float64)
        east, north = (points - here[:, XY]).T
        heading = here[:, Sample.HEADING]
        return np.asarray(north * np.cos(heading) - east * np.sin(heading))

    def stretch(self, position: Floats, points: NDArray[np.float64]) -> Floats:
        """How much faster the nearest place on the route moves than the point itself, going along: (position,).

        points: (position, 2) [m]. More than 1 on the inside of a bend, where drivers cut the corner; their speed
        over the ground would not cover the arc length that they do.
        """
        left = self.left(position, points)
        ends = np.clip([position - BEND, position + BEND], 0.0, self.route.length)
        before, after = (self._samples(one)[:, Sample.HEADING].astype(np.float64) for one in ends)
        turn = (after - before + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray(1.0 / np.maximum(1.0 - left * turn / (ends[1] - ends[0]), 1.0 / MOST_STRETCH))

    def _samples(self, position: Floats) -> NDArray[np.float32]:
        return self.intersection.sample(self.route.index, position.astype(np.float32))
