"""What the stages of `make reproduce` share: options, where things lie, and what was done."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from agents.training.options import Maps
from data.build import maps_of
from experiments.reproduce.simulated_scenes import larger_scenes
from experiments.reproduce.stages import Stages
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.places import load_places
from intersection_env.scenes.scenes import Scenes

SIMULATED = Path("data/recordings").resolve()


@dataclass(frozen=True)
class Options:
    """Every table and figure of the paper, re-run."""

    recordings: Path = Path("data/recordings")
    """The folder of the recordings: inD's, INTERACTION's or CommonRoad's."""
    map: Maps = ()
    """Maps (names, or files) of the places to learn from; none: each that ships and has recordings in the folder. The
    paper's figures are measured at the first one."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Of the drivers' trainings; the one with the least error on development is the policy that is reported."""
    work: Path = Path("out/reproduce")
    """The folder for scenes, runs and policies."""
    out: Path = Path("experiments/results")
    """The folder of the results and the report."""
    only: Literal["everything", "training"] = "everything"
    """Training alone, or all of it."""
    ship: bool = False
    """Copy the policies into the package."""
    effort: float = 1.0
    """Share of the epochs of each training; less is for trying this out."""
    scenes_timed: int = 2000
    """Random scenes for each number of vehicles, in the runtime figure."""


class Workspace:
    """Where the stages lay down what they make, and what each needs of those before it; the first ones are the scenes.

    Raises:
        ValueError: no seeds, no effort or no scenes to time.
    """

    def __init__(self, options: Options) -> None:
        if not options.seeds:
            raise ValueError("--seeds names no seed; wanted at least one")
        if not options.effort > 0.0:
            raise ValueError(f"--effort is {options.effort:g}; wanted more than 0")
        if options.scenes_timed < 1:
            raise ValueError(f"--scenes-timed is {options.scenes_timed}; wanted at least 1")
        self.options = options
        self.stages = Stages(options.work)
        self.keys: dict[str, str] = {}
        self.names: list[str] = []

    @cached_property
    def places(self) -> tuple[Intersection, ...]:
        """The maps of the places, the first one that of the paper's figures.

        Raises:
            FileNotFoundError, ValueError, OSError: as of `data.build.maps_of`.
        """
        return maps_of(self.options.recordings, self.options.map)

    def policy(self, name: str) -> Path:
        """Where a trained policy lies."""
        return self.options.work / "policies" / f"{name}.policy"

    def forecasting(self, name: str) -> Path:
        """Where a trained policy lies with what forecasts need: what ships."""
        return self.options.work / "forecasting" / f"{name}.policy"

    def scenes_of(self, place: Intersection) -> Path:
        """A place's scenes file."""
        return self.options.work / "scenes" / f"{place.name}.npz"

    def load(self, place: Intersection) -> Scenes:
        """A place's scenes."""
        return Scenes.load(self.scenes_of(place), place)

    @property
    def scenes(self) -> Scenes:
        """The scenes of the first place."""
        return self.load(self.places[0])

    def all_scenes(self) -> tuple[Scenes, ...]:
        """The scenes of all places."""
        return load_places([self.scenes_of(place) for place in self.places], self.places)

    def arguments(self, places: Sequence[Intersection]) -> list[str]:
        """What commands are told of some places' scenes: `--scenes ... --map ...`."""
        return _told([self.scenes_of(place) for place in places], [self._map_of(place) for place in places])

    def learned_from(self, places: Sequence[Intersection], files: Sequence[Path] = ()) -> list[str]:
        """Likewise, of some places and, where recordings are simulated, of the same so many times as large.

        files: scenes files of the places, others than those that all stages have.
        """
        larger = self.larger(places) if self.simulated else []
        files = [*(files or [self.scenes_of(place) for place in places]), *(file for file, _ in larger)]
        return _told(files, [*(self._map_of(place) for place in places), *(str(source) for _, source in larger)])

    def larger(self, places: Sequence[Intersection]) -> list[tuple[Path, Path]]:
        """Scenes files and maps of these places so many times as large, simulated unless they are there."""
        return larger_scenes(places, self.options.work / "larger")

    def maps(self) -> list[str]:
        """The maps of all places as commands are told of them: names, or files."""
        return [self._map_of(place) for place in self.places]

    def _map_of(self, place: Intersection) -> str:
        """A map's name, or its file where it was told by one."""
        told = dict(zip(self.places, self.options.map, strict=True)) if self.options.map else {}
        return told.get(place, place.name)

    @property
    def simulated(self) -> bool:
        """Whether the recordings are those that ship."""
        return self.options.recordings.resolve() == SIMULATED

    @property
    def larger_made(self) -> Path:
        """Which scenes of larger places there are, by the hash of each."""
        return self.options.work / "larger" / "made.json"

    @property
    def default(self) -> Path:
        """Which policy is the default, and why."""
        return self.options.work / "default.json"

    def epochs(self, whole: int) -> int:
        """How many of a whole training's epochs a training lasts here."""
        return max(1, round(self.options.effort * whole))

    def run_of(self, name: str) -> Path:
        """Where a training keeps what it needs to go on; a folder apart for other scenes, or another effort.

        A training cannot go on with those. With more seeds it can, so these are no part of it.
        """
        decisive = json.dumps([[self.keys[name] for name in self.scenes_stages()], self.options.effort])
        return self.options.work / "runs" / hashlib.sha256(decisive.encode()).hexdigest()[:8] / name

    def scenes_stages(self) -> list[str]:
        """The stages that make the scenes, one a place."""
        return [f"scenes_{place.name}" for place in self.places]

    def stage(self, name: str, after: Sequence[str], output: Path, work: Callable[[], None], **inputs: Any) -> None:
        """A stage that depends on earlier ones, and on `inputs`."""
        needs = {
            "version": version("intersection_env"),
            "inputs": inputs,
            "after": {one: self.keys[one] for one in after},
        }
        self.keys[name] = self.stages.run(name, needs, output, work)
        self.names.append(name)

    def seconds(self) -> dict[str, float]:
        """What each stage took [s], the last time it was done."""
        return self.stages.seconds(self.names)


def _told(files: Sequence[Path], maps: Sequence[str]) -> list[str]:
    return ["--scenes", *map(str, files), "--map", *maps]
