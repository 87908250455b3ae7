"""The places whose traffic is simulated: how many recordings of each, how much traffic, what a camera sees of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from intersection_env.maps.intersection import MAPS


@dataclass(frozen=True)
class Place:
    """A place, its traffic and its recordings.

    main_flow, side_flow: vehicles an hour that come along an arm of the main road, and of a side road; view: how far
    before an arm's stop line, and beyond the junction's end, the field of view reaches [m], by the arm's right of way.
    """

    map: str
    location: int
    numbers: dict[str, range]
    """By split."""
    main_flow: float
    side_flow: float
    view: dict[str, float]
    folder: Path = MAPS

    @property
    def recordings(self) -> list[int]:
        """The numbers of all its recordings."""
        return sorted(number for numbers in self.numbers.values() for number in numbers)

    @property
    def source(self) -> Path:
        """The map's source file."""
        return self.folder / f"{self.map}.json"


BENDPLATZ = Place(
    map="bendplatz",
    location=901,
    numbers={"train": range(0, 12), "development": range(12, 15), "validation": range(15, 20)},
    main_flow=280.0,
    side_flow=131.0,
    view={"priority": 35.0, "yield": 20.0, "stop": 20.0},  # paper, Section IV-A
)
T_JUNCTION = Place(
    map="t_junction",
    location=902,
    numbers={"train": range(20, 26), "development": range(26, 28), "validation": range(28, 30)},
    main_flow=340.0,
    side_flow=140.0,
    view={"priority": 55.0, "yield": 40.0},  # ours: from higher up, so that models see other fields of view too
)
CROSSROADS = Place(
    map="crossroads",
    location=903,
    numbers={"train": range(30, 36), "development": range(36, 38), "validation": range(38, 40)},
    main_flow=300.0,
    side_flow=120.0,
    view={"priority": 50.0, "yield": 30.0},  # ours
)
PLACES = (BENDPLATZ, T_JUNCTION, CROSSROADS)
NUMBERS = [number for place in PLACES for number in place.recordings]
"""Of all recordings."""


def place_of(number: int) -> Place:
    """The place of a recording.

    Raises:
        ValueError: there is no recording of that number.
    """
    for place in PLACES:
        if number in place.recordings:
            return place
    raise ValueError(f"no recording has number {number}; there are 0 to {NUMBERS[-1]}")
