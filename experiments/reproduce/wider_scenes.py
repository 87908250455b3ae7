"""The places that ship with drivers who differ more, simulated anew: what an ablation learns from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from data.build import build
from data.sumo.generate import generate
from data.sumo.places import PLACES
from intersection_env.maps.intersection import Intersection

WIDER = 2.0  # ours: times as different as usual
SPLITS = ("train", "development")


def wider_scenes(places: Sequence[Intersection], folder: Path) -> list[Path]:
    """The scenes files of some places in the order given, made unless they are there.

    Raises:
        ValueError: a map that no recordings are simulated on.
    """
    files = [folder / f"{place.name}.npz" for place in places]
    for place, file in zip(places, files, strict=True):
        if not file.is_file():
            recordings = folder / place.name
            _simulate(place, recordings)
            build(recordings, place).save(file)
    return files


def _simulate(place: Intersection, folder: Path) -> None:
    """Those to learn from and to watch; what the report measures stays as it is."""
    where = next((one for one in PLACES if one.map == place.name), None)
    if where is None:
        raise ValueError(f'map "{place.name}": recordings are simulated on {", ".join(one.map for one in PLACES)} only')
    numbers = [number for split in SPLITS for number in where.numbers[split]]
    with ProcessPoolExecutor(os.cpu_count()) as workers:
        list(workers.map(partial(generate, folder=folder, wider=WIDER), numbers))
