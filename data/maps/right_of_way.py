"""Who yields at a junction: by the map's rules and signs, else guessed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from data.maps.arms import ArmLanes
from data.maps.lanelets import LaneMap
from data.maps.paths import Way

MAIN = np.radians(45.0)  # ours: the two arms of a main road are opposite by at least 180 degrees less this


def rights_of_arms(
    lane_map: LaneMap, arms: Sequence[ArmLanes], ways: Mapping[str, Way], guessed: list[str]
) -> dict[str, str]:
    """By arm, the word that a source has for it; what no rule or sign says is added to `guessed`, in words.

    ways: by route id.
    """
    found: dict[str, str] = {}
    for arm in arms:
        own = {id: way for id, way in ways.items() if id.partition("-")[0] == arm.name}
        said = _by_rule(lane_map, own, ways) or _by_sign(lane_map, own)
        if said is not None:
            found[arm.name] = said
        elif not own:
            found[arm.name] = "priority"  # nobody comes from there
    open_ = [arm for arm in arms if arm.name not in found]
    with_traffic = {id.partition("-")[0] for id in ways}
    if not open_:
        return found
    if any(name in with_traffic for name in found):
        other = "yield" if any(found[name] == "priority" for name in found if name in with_traffic) else "priority"
        for arm in open_:
            found[arm.name] = other
            guessed.append(f'arm "{arm.name}": "{other}", for other arms have signs or rules and it has none')
        return found
    main = _main_road(open_)
    for arm in open_:
        found[arm.name] = "right_before_left" if not main else "priority" if arm.name in main else "yield"
    if main:
        guessed.append(f"right of way: nothing in the file; the main road is {main[0]} and {main[1]}, others yield")
    else:
        guessed.append("right of way: nothing in the file and no road has more lanes; right before left")
    return found


def yields_by_rule(lane_map: LaneMap, one: Way, other: Way) -> bool | None:
    """Whether the first way waits for the second by a rule of the map; None where none speaks of the two."""
    first, second = set(one.approach[-1:] + one.inside), set(other.approach[-1:] + other.inside)
    for right in lane_map.rights:
        waits = bool(first & right.yields) and not first & right.prior
        goes = bool(second & right.prior) and not second & right.yields
        if waits and goes:
            return True
        waits = bool(second & right.yields) and not second & right.prior
        goes = bool(first & right.prior) and not first & right.yields
        if waits and goes:
            return False
    return None


def _by_rule(lane_map: LaneMap, own: Mapping[str, Way], ways: Mapping[str, Way]) -> str | None:
    """What rules say of an arm: it is minor if each of its lanes waits, by one rule, for somebody of another arm."""
    if not any((right.yields | right.prior) & _lanelets(way) for right in lane_map.rights for way in own.values()):
        return None
    by_lane: dict[str, list[bool]] = {}
    stops = False
    for id, way in own.items():
        waits = False
        for right in lane_map.rights:
            others = [one for other, one in ways.items() if other.partition("-")[0] != id.partition("-")[0]]
            hit = bool(_lanelets(way) & right.yields) and any(_lanelets(one) & right.prior for one in others)
            waits |= hit
            stops |= hit and right.stops
        by_lane.setdefault(way.approach[-1], []).append(waits)
    minor = all(all(lane) for lane in by_lane.values())
    return ("stop" if stops else "yield") if minor else "priority"


def _by_sign(lane_map: LaneMap, own: Mapping[str, Way]) -> str | None:
    """What signs say of an arm: those before the junction, else those on the first lanelets inside it.

    Maps hang a sign on each lanelet that it may concern, and some on others, too: what all ways have counts first.
    """
    for part in ("approach", "inside"):
        each = []
        for way in own.values():
            ids = way.approach if part == "approach" else way.inside[:1]
            each.append(frozenset().union(*(lane_map.lanelets[id].signs for id in ids)))
        each = [signs for signs in each if signs]
        common = frozenset.intersection(*each) if each else frozenset()
        for sign in ("all_way_stop", "stop", "yield", "priority"):
            if sign in (common or frozenset().union(*each)):
                return sign
    return None


def _lanelets(way: Way) -> set[str]:
    return set(way.approach[-1:] + way.inside)


def _main_road(arms: Sequence[ArmLanes]) -> tuple[str, str] | None:
    """The two arms that lie opposite each other and have more lanes than every other two; None where none has."""
    scored = []
    for number, one in enumerate(arms):
        for other in arms[number + 1 :]:
            apart = abs((one.bearing - other.bearing + np.pi) % (2.0 * np.pi) - np.pi)
            if np.pi - apart < MAIN:
                lanes = sum(len(each) for arm in (one, other) for each in (arm.approaches, arm.exits))
                scored.append((lanes, one.name, other.name))
    scored.sort(reverse=True)
    if not scored or (len(scored) > 1 and scored[0][0] == scored[1][0]):
        return None
    return scored[0][1:]
