"""Scenes simulated anew of the places that ship: with drivers who differ more, and on larger junctions."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import chain
from pathlib import Path

from data.build import build
from data.sumo.generate import generate
from data.sumo.larger import larger as larger_place
from data.sumo.places import PLACES, Place
from data.sumo.recording_files import write_settings
from intersection_env.maps.intersection import Intersection

WIDER = 2.0  # ours: times as different as usual
LARGER = (1.5, 2.2)  # ours: times as large as usual
OF_LARGER = {"train": 2, "development": 1}  # ours: recordings of each larger place; there are twice as many places
SPLITS = ("train", "development")


def wider_scenes(places: Sequence[Intersection], folder: Path) -> list[Path]:
    """The scenes files of some places with drivers who differ more, in the order given, made unless they are there.

    Raises:
        ValueError: a map that no recordings are simulated on.
    """
    files = [folder / f"{place.name}.npz" for place in places]
    for place, file in zip(places, files, strict=True):
        if not file.is_file():
            _simulate({split: _simulated(place).numbers[split] for split in SPLITS}, folder / place.name, wider=WIDER)
            build(folder / place.name, place).save(file)
    return files


def larger_scenes(places: Sequence[Intersection], folder: Path) -> list[tuple[Path, Path]]:
    """The scenes files of some places so many times as large, and their maps, likewise.

    Raises:
        ValueError: as `wider_scenes`.
    """
    found = []
    for where in map(_simulated, places):
        for times in LARGER:
            recordings = folder / f"{where.map}_{times:g}"
            recordings.mkdir(parents=True, exist_ok=True)
            source = larger_place(where, times, recordings).source
            file = folder / f"{source.stem}.npz"
            if not file.is_file():
                _simulate(
                    {split: where.numbers[split][:count] for split, count in OF_LARGER.items()},
                    recordings,
                    larger=times,
                )
                build(recordings, Intersection.load(source)).save(file)
            found.append((file, source))
    return found


def _simulated(place: Intersection) -> Place:
    """Where recordings are simulated on that map."""
    where = next((one for one in PLACES if one.map == place.name), None)
    if where is None:
        raise ValueError(f'map "{place.name}": recordings are simulated on {", ".join(one.map for one in PLACES)} only')
    return where


def _simulate(numbers: Mapping[str, Sequence[int]], folder: Path, wider: float = 1.0, larger: float = 1.0) -> None:
    """Recordings to learn from and to watch, by split; what the report measures stays as it is."""
    with ProcessPoolExecutor(os.cpu_count()) as workers:
        simulate = partial(generate, folder=folder, wider=wider, larger=larger)
        list(workers.map(simulate, chain.from_iterable(numbers.values())))
    split = {name: [f"{number:02d}" for number in some] for name, some in numbers.items()}
    about = {"made_by": "python -m experiments.reproduce", "wider": wider, "larger": larger}
    write_settings(folder, {**about, "split": split})
