"""Moves the lanes of a map source step by step to where recorded cars drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from data.align.drives import Drive, find_drives
from data.align.shift import LaneShift, following, lane_shifts, shifted
from data.recording import Recording
from intersection_env.maps.compiler import Recompiler, compile_map
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.source import MapSource

ROUNDS = 2  # ours: on lanes that were moved once more cars are found, and all of them nearer
SHARES = (1.0, 0.5, 0.25, 0.0)  # ours: of a shift, tried in turn until the map compiles
LEAST_CARS = 5  # ours: fewer say how they drove, not where the lane is


@dataclass(frozen=True)
class Alignment:
    """A map before and after.

    drives: the cars on the map before, and on the map after. shifts: of each round, by lane, as they were
    applied. limited: what was applied in part or not at all, and why.
    """

    source: MapSource
    before: Intersection
    after: Intersection
    drives: tuple[list[Drive], list[Drive]]
    shifts: tuple[dict[str, LaneShift], ...]
    limited: tuple[str, ...]


def align(
    source: MapSource, before: Intersection, recordings: Sequence[Recording], least_cars: int = LEAST_CARS
) -> Alignment:
    """The source with its lanes where the recordings' cars and trucks drive; `before` is what it compiles to.

    Raises:
        ValueError: no car fits one of its routes.
    """
    after = before
    first = drives = find_drives(recordings, before)
    if not drives:
        raise ValueError(f'no car of the recordings drives on a route of map "{source.name}"')
    recompiler = Recompiler()
    applied: list[dict[str, LaneShift]] = []
    limited: list[str] = []
    for number in range(1, ROUNDS + 1):
        shifts = lane_shifts(source, after, drives, least_cars)
        source, after, shifts, words = _moved_as_far_as_possible(source, after, shifts, recompiler)
        drives = find_drives(recordings, after)
        applied.append(shifts)
        limited += [f"round {number}: {word}" for word in words]
    return Alignment(source, before, after, (first, drives), tuple(applied), tuple(limited))


def compiled(source: MapSource) -> Intersection:
    """The map of a source.

    Raises:
        ValueError: the source contradicts itself.
    """
    return Intersection(compile_map(source), source.name)


def _moved_as_far_as_possible(
    source: MapSource, intersection: Intersection, shifts: dict[str, LaneShift], recompiler: Recompiler
) -> tuple[MapSource, Intersection, dict[str, LaneShift], list[str]]:
    """All lanes moved, or one after the other, the most driven first, each as far as the map still compiles; those that
    follow each other together."""
    moved = shifted(source, shifts)
    try:
        return moved, Intersection(recompiler.compile(moved), moved.name), shifts, []
    except ValueError:
        pass
    applied: dict[str, LaneShift] = {}
    words: list[str] = []
    for names in _chains(source, shifts):
        why = ""
        for share in SHARES:
            part = {name: shifts[name].times(share) for name in names}
            applied |= part
            tried = shifted(source, part)
            try:
                intersection, source = Intersection(recompiler.compile(tried), tried.name), tried
            except ValueError as error:
                why = why or str(error)
                continue
            break
        if why:
            one = f'lane "{names[0]}" moves' if len(names) == 1 else f'lanes "{", ".join(names)}" move'
            words.append(f"{one} by {100 * share:g} % of the shift only, else {why}")
    return source, intersection, applied, words


def _chains(source: MapSource, shifts: Mapping[str, LaneShift]) -> list[list[str]]:
    """The lanes that move, those that follow each other together, the most driven first."""
    chain = {name: [name] for name in shifts}
    for one, other in following(source):
        if one in chain and other in chain and chain[one] is not chain[other]:
            joined = chain[one] + chain[other]
            chain |= dict.fromkeys(joined, joined)
    every = {id(names): sorted(names, key=lambda name: -shifts[name].cars) for names in chain.values()}
    return sorted(every.values(), key=lambda names: -shifts[names[0]].cars)
