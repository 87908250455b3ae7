"""What moves in a picture of traffic: vehicles, recorded ones, and who waits for whom. Needs pygame."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pygame
from numpy.typing import NDArray

from intersection_env.maps.intersection import XY, Intersection
from intersection_env.maps.outline import directions
from intersection_env.render.camera import Camera
from intersection_env.render.ink import (
    DIM,
    HELD,
    INK,
    MARGIN,
    SECOND,
    SHRINK,
    SPEEDS,
    WAITING,
    Lettering,
    Shape,
    draw_arrows,
    paint,
)
from intersection_env.render.snapshot import Ghosts, Snapshot

BODY = np.array([(-1, -1), (1, -1), (1, -1), (1, 1), (1, 1), (-1, 1), (-1, 1), (-1, -1)], dtype=np.float64)
CUT = np.array(
    [(0.12, 0.0), (-0.45, 0.0), (0.0, 0.32), (0.0, -0.32), (-0.45, 0.0), (0.12, 0.0), (0.0, -0.12), (0.0, 0.12)]
)
"""A body's eight corners from its centre: `BODY` half lengths and widths, and `CUT` metres."""
GLASS_BEHIND, GLASS_ASIDE = np.array([(0.24, 0.42, 0.42, 0.24), (0.82, 0.66, -0.66, -0.82)])
"""A windscreen's corners: shares of a car's length behind the front, and of half its width to the left."""
GLASS_CAR = 5.0  # [m], length beyond which a windscreen stays where it is
EDGE = 0.8  # [nominal pixel], a body's outline
LEAST_INSIDE = 0.65  # share of a body's length and width that its outline leaves to its colour
BAR_GAP, BAR_DEPTH = 0.35, 0.55  # [m], of the bar before a vehicle that is held
RING, RING_WIDTH = 0.55, 0.3  # [m], between the acting vehicle and the ring around it, and that ring's width
LABEL_GAP = 2.3  # [m] from a body to the middle of its label
CLEAR = 0.4  # [m] between an arrow's tip and the vehicle it points to


@dataclass(frozen=True, eq=False)
class Bodies:
    """Where the bodies of some vehicles lie: all (vehicle, 2) but the halves.

    centre: [m]; forward, left: unit vectors; half_length, half_width: (vehicle, 1) [m].
    """

    centre: NDArray[np.float64]
    forward: NDArray[np.float64]
    left: NDArray[np.float64]
    half_length: NDArray[np.float64]
    half_width: NDArray[np.float64]

    @classmethod
    def of(cls, intersection: Intersection, vehicles: Snapshot | Ghosts) -> Bodies:
        """The bodies of these vehicles."""
        samples = intersection.sample_each(vehicles.route, vehicles.position).astype(np.float64)
        halves = (0.5 * size[:, None].astype(np.float64) for size in (vehicles.length, vehicles.width))
        return cls(samples[:, XY], *directions(samples), *halves)

    def one(self, index: int) -> Bodies:
        """One of the bodies alone."""
        which = slice(index, index + 1)
        return Bodies(*(getattr(self, field.name)[which] for field in fields(self)))

    def __len__(self) -> int:
        return len(self.centre)

    def outlines(self, wider: float) -> NDArray[np.float64]:
        """The corners of all bodies, so much wider on each side [m]: (vehicle, 8, 2) [m]."""
        half = np.stack([self.half_length, self.half_width], axis=2)
        half = np.maximum(half + wider, LEAST_INSIDE * half)
        _, half_width = np.split(half, 2, axis=2)
        return self.place(half * BODY + np.minimum(1.0, half_width) * CUT)

    def place(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points given by metres ahead of and to the left of each centre: (vehicle, point, 2) [m]."""
        ahead, aside = np.split(local, 2, axis=2)
        return np.asarray(self.centre[:, None] + ahead * self.forward[:, None] + aside * self.left[:, None])

    def glass(self) -> NDArray[np.float64]:
        """The corners of all windscreens: (vehicle, 4, 2) [m]."""
        car = np.minimum(2.0 * self.half_length, GLASS_CAR)
        return self.place(np.stack([self.half_length - car * GLASS_BEHIND, self.half_width * GLASS_ASIDE], axis=2))

    def bars(self, depth: float) -> NDArray[np.float64]:
        """The corners of bars before all fronts: (vehicle, 4, 2) [m]."""
        near = self.half_length + BAR_GAP
        ahead = np.concatenate([near, near + depth, near + depth, near], axis=1)
        return self.place(np.stack([ahead, self.half_width * (1.0, 1.0, -1.0, -1.0)], axis=2))

    def fronts(self, ahead: float) -> NDArray[np.float64]:
        """The points so far ahead of the bodies [m]: (vehicle, 2) [m]."""
        return np.asarray(self.centre + (self.half_length + ahead) * self.forward)

    def borders(self, which: NDArray[np.integer], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the ways from points (n, 2) to the centres of bodies `which` meet their borders, or a little before."""
        way = points - self.centre[which]
        ahead = np.abs((way * self.forward[which]).sum(axis=1, keepdims=True))
        aside = np.abs((way * self.left[which]).sum(axis=1, keepdims=True))
        inside = np.minimum(
            self.half_length[which] / np.maximum(ahead, 1e-6), self.half_width[which] / np.maximum(aside, 1e-6)
        )
        share = np.minimum(1.0, inside + CLEAR / np.maximum(np.hypot(ahead, aside), 1e-6))
        return np.asarray(self.centre[which] + share * way)


def draw_snapshot(
    surface: pygame.Surface, intersection: Intersection, camera: Camera, snapshot: Snapshot, lettering: Lettering
) -> None:
    """Draws what moves onto the road."""
    if snapshot.ghosts is not None:
        _draw_ghosts(surface, camera, Bodies.of(intersection, snapshot.ghosts))
    bodies = Bodies.of(intersection, snapshot)
    for pairs, style in ((snapshot.waits_for, WAITING), (snapshot.assigned, SECOND)):
        if len(pairs):
            waiting, awaited = pairs.T
            tails = bodies.fronts(BAR_GAP + BAR_DEPTH)[waiting]
            tips = bodies.borders(awaited, tails)
            draw_arrows(surface, camera.pixels(tails), camera.pixels(tips), style, camera.stroke)
    if snapshot.highlight is not None:
        _draw_ring(surface, camera, bodies.one(snapshot.highlight))
    if len(bodies):
        _draw_bodies(surface, camera, bodies, snapshot)
    if camera.has_letters:
        _draw_letters(surface, camera, bodies, snapshot, lettering)


def _draw_bodies(surface: pygame.Surface, camera: Camera, bodies: Bodies, snapshot: Snapshot) -> None:
    pixel = camera.stroke / camera.scale
    outer, inner = bodies.outlines(-SHRINK / camera.scale), bodies.outlines(-EDGE * pixel)
    bars = bodies.bars(max(BAR_DEPTH, 2.0 * pixel))
    bars[snapshot.enters] = outer[snapshot.enters, :4]  # is not painted, and so takes no room
    share = np.clip(snapshot.speed / np.maximum(snapshot.v_max, 0.1), 0.0, 1.0)
    shapes: list[list[Shape]] = []
    for enters, shade in zip(snapshot.enters.tolist(), np.rint(share * (len(SPEEDS) - 1)).tolist(), strict=True):
        body: list[Shape] = [(0, 8, (*INK, 255)), (8, 16, (*SPEEDS[int(shade)], 255)), (16, 20, (*INK, 255))]
        shapes.append(body if enters else [*body, (20, 24, (*HELD, 255))])
    paint(surface, camera.pixels(np.concatenate([outer, inner, bodies.glass(), bars], axis=1)), shapes)


def _draw_ring(surface: pygame.Surface, camera: Camera, acting: Bodies) -> None:
    width = max(RING_WIDTH, 1.4 * camera.stroke / camera.scale)
    corners = np.concatenate([acting.outlines(RING + width), acting.outlines(RING)], axis=1)
    paint(surface, camera.pixels(corners), [[(0, 8, (*INK, 255)), (8, 16, (*INK, 0))]])


def _draw_ghosts(surface: pygame.Surface, camera: Camera, bodies: Bodies) -> None:
    if len(bodies):
        corners = np.concatenate([bodies.outlines(0.0), bodies.outlines(-1.3 * camera.stroke / camera.scale)], axis=1)
        ghost: list[Shape] = [(0, 8, (*INK, 150)), (8, 16, (*INK, 26))]
        paint(surface, camera.pixels(corners), [ghost] * len(bodies))


def _draw_letters(
    surface: pygame.Surface, camera: Camera, bodies: Bodies, snapshot: Snapshot, lettering: Lettering
) -> None:
    unit = camera.letter
    if snapshot.labels is not None:
        aside = bodies.centre - (bodies.half_width + LABEL_GAP) * bodies.left
        for (x, y), label in zip(camera.pixels(aside).tolist(), snapshot.labels, strict=True):
            lettering.draw(surface, label, (x, y + 5.0 * unit), DIM, align=0.5)
    lines = [] if snapshot.time is None else [(f"{snapshot.time:.1f} s", INK)]
    lines += [] if snapshot.caption is None else [(snapshot.caption, DIM)]
    for row, (text, colour) in enumerate(lines):
        lettering.draw(surface, text, (MARGIN * unit, (MARGIN + 12.0 + 16.0 * row) * unit), colour)
