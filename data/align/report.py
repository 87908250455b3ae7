"""What an alignment did, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from data.align.align import Alignment
from data.align.drives import Drive
from data.align.shift import inside_of
from intersection_env.maps.intersection import Intersection

HEADER = f"{'route':<10}{'cars':>6}{'left':>8}{'aside':>8}{'95 %':>8}   {'cars':>6}{'left':>8}{'aside':>8}{'95 %':>8}"


def report(alignment: Alignment) -> str:
    """A table of how far cars drive from each route before and after, the lanes' shifts, and what was limited."""
    lines = [f"{'':<10}{'before [m]':>30}   {'after [m]':>30}", HEADER]
    before = _figures(alignment.before, alignment.drives[0])
    after = _figures(alignment.after, alignment.drives[1])
    lines += [f"{route.id:<10}{before[route.index]}   {after[route.index]}" for route in alignment.before.routes]
    lines.append("left: the median of how far left of the line a car drives; aside: of the distance, whichever side")
    lines.append("lanes, moved to the left in all rounds together [m]:")
    ways = [inside_of(route.id) for route in alignment.source.routes if route.inside is not None]
    for name in (*alignment.source.lanes, *ways):
        lines.append(f"  {name:<20} {_shift(alignment, name)}")
    return "\n".join([*lines, *alignment.limited])


def _figures(intersection: Intersection, drives: Sequence[Drive]) -> list[str]:
    rows = []
    for route in intersection.routes:
        own = [drive.left for drive in drives if drive.route == route.index]
        if not own:
            rows.append(f"{0:6d}{'':>24}")
            continue
        left = np.concatenate(own)
        aside = np.abs(left)
        figures = f"{np.median(left):+8.2f}{np.median(aside):8.2f}{np.quantile(aside, 0.95):8.2f}"
        rows.append(f"{len(own):6d}{figures}")
    return rows


def _shift(alignment: Alignment, name: str) -> str:
    rounds = [shifts[name] for shifts in alignment.shifts if name in shifts]
    if not rounds:
        return "stays: too few cars"
    total = [sum(float(np.interp(share, [0.0, 1.0], one.left[[0, -1]])) for one in rounds) for share in (0.0, 1.0)]
    return f"{total[0]:+.2f} at its begin, {total[1]:+.2f} at its end ({rounds[-1].cars} cars)"
