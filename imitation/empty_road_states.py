"""What a car sees on an empty road: states that no recording has, as there others are about.

It enters (delta is 1) wherever no stop is to be made; before its stop sign it has yet to stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.replay import ReplayWorlds

STANDING = 0.2
"""Share of states that are of a standstill; ours: recorded vehicles that stand wait for somebody, or did just now."""
FASTEST = 0.7
"""Of what is allowed, the speed up to which the others are; ours: whoever is faster does not stand, and recorded
vehicles are as fast everywhere."""
LENGTHS, WIDTH = (3.8, 5.2), 1.85  # [m], of cars, as in the closed loop
STEPS = round(1.0 / DT) + 1  # the shortest track that may act


class Car(NamedTuple):
    """A car on a map."""

    route: int
    position: float
    speed: float
    length: float


def seen_alone(intersection: Intersection, cars: Sequence[Car]) -> NDArray[np.float32]:
    """Features (car, 12) of each car if nobody else is there."""
    scenes = tuple(_scene(car, str(number)) for number, car in enumerate(cars))
    worlds = ReplayWorlds(Scenes(intersection, scenes, {}, {}), split=None, worlds=len(cars), autoreset="off")
    worlds.reset(0)
    for world, track in enumerate(worlds.tracks.actors):
        worlds.start(world, int(track))
    return worlds.observation.copy()


def empty_road_states(intersection: Intersection, count: int, random: np.random.Generator) -> NDArray[np.float32]:
    """Features (count, 12) of a car alone, anywhere on any route, that stands or is slower than is allowed there."""
    return seen_alone(intersection, [_drawn(intersection, random) for _ in range(count)])


def _drawn(intersection: Intersection, random: np.random.Generator) -> Car:
    route = intersection.routes[int(random.integers(len(intersection.routes)))]
    position = random.uniform(0.0, route.length)
    allowed = float(intersection.sample(route.index, np.array([position], np.float32))[0, Sample.V_MAX])
    speed = 0.0 if random.random() < STANDING else random.uniform(0.0, FASTEST * allowed)
    return Car(route.index, position, speed, random.uniform(*LENGTHS))


def _scene(car: Car, id: str) -> Scene:
    """One car, of whose track the first state counts."""
    track = Track(
        id=id,
        road_user="car",
        route=car.route,
        length=car.length,
        width=WIDTH,
        start=0,
        position=np.full(STEPS, car.position, np.float32),
        speed=np.full(STEPS, car.speed, np.float32),
        acceleration=np.zeros(STEPS, np.float32),
        observed=np.ones(STEPS, np.bool_),
    )
    return Scene(id, "none", "train", 0.0, STEPS, (track,))
