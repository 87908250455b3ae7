"""A map of lanes and one of its junctions to a map source, with what was guessed and what was left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.maps.arms import ArmLanes, find_arms
from data.maps.bend import least_bent, room_of
from data.maps.junction import Circle, chosen, cut_at_junction, junctions, meetings
from data.maps.lanelets import LaneMap
from data.maps.paths import Way, find_paths
from data.maps.right_of_way import rights_of_arms, yields_by_rule
from data.maps.ring import arms_of_ring, around, ring_of
from data.maps.room import length_of, with_room
from data.maps.smooth import polyline, telling
from data.maps.stop_lines import with_stop_lines
from intersection_env.maps.compiler import compile_map, encounters
from intersection_env.maps.conflicts import Encounter
from intersection_env.maps.source import FORMAT, VERSION, MapSource
from intersection_env.maps.source_entries import Arm, Lane, RouteSource

OFFERED = 12  # ours: of so many junctions it is tried whether a source can be made of them
LIMIT = 50.0  # [km/h], ours: guessed where the map says none
SHORT = 20.0  # [m], ours: an approach shorter than this leaves no room for who waits there


@dataclass
class Imported:
    """A map source and how it came about.

    guessed: what the file does not say, a line each, for a person to check. counts: what was left out, by reason.
    """

    source: MapSource
    circle: Circle
    guessed: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def content(self, about: str) -> dict[str, Any]:
        """The source as its file holds it."""
        source = self.source
        routes: dict[str, dict[str, Any]] = {}
        for one in source.routes:
            routes[one.id] = {"approach": list(one.approach), "exit": list(one.leaving)}
            if one.inside is not None:
                routes[one.id]["inside"] = one.inside.tolist()
            if one.interior:
                routes[one.id]["inside"] = list(one.interior)
        return {
            "format": FORMAT,
            "version": VERSION,
            "name": source.name,
            "about": about,
            "locations": list(source.locations),
            "arms": {
                name: {"right_of_way": arm.right_of_way, "speed_limit_kmh": round(3.6 * arm.speed_limit, 1)}
                for name, arm in source.arms.items()
            },
            "lanes": {
                name: {"width": lane.width.tolist(), "points": lane.points.tolist()}
                for name, lane in source.lanes.items()
            },
            "stop_lines": {name: line.tolist() for name, line in source.stop_lines.items()},
            "routes": routes,
            "yields": [list(pair) for pair in sorted(source.yields)],
            "free": sorted(sorted(pair) for pair in source.free),
        }


def source_of(lane_map: LaneMap, name: str, around: Circle | None, locations: Sequence[int] = ()) -> Imported:
    """The junction found, or the one around a circle, as a map source that compiles.

    Raises:
        ValueError: no junction is found, several are and none is chosen, or no lane leads through it.
    """
    circles = junctions(meetings(lane_map))
    if around is None and len(circles) > 1:
        circles = _usable(lane_map, name, circles)
    circle = chosen(circles, around)
    lane_map, inside = cut_at_junction(lane_map, circle)
    counts = Counter({f"lanelet: {why}": count for why, count in lane_map.left_out.items()})
    counts.update({f"not read: {what}": count for what, count in lane_map.ignored.items()})
    dropped: Counter[str] = Counter()
    ways = find_paths(lane_map, circle, inside, dropped)
    arms = find_arms(lane_map, circle, ways)
    named = _named(arms, ways)
    counts.update({f"way: {why}": count for why, count in dropped.items() if count})
    guessed = _loose_joints(lane_map, named)
    ring = ring_of(lane_map, inside)
    rights = _rights(lane_map, arms, named, ring, guessed)
    limits = {arm.name: _limit(lane_map, arm, named, guessed) for arm in arms}
    lanes, routes = _lanes(lane_map, arms, named, ring)
    used = {route.entry for route in routes} | {route.exit for route in routes}
    by_name = {arm.name: Arm(rights[arm.name], limits[arm.name]) for arm in arms if arm.name in used}
    source = MapSource(name, tuple(locations), by_name, lanes, {}, tuple(routes), frozenset())
    source = with_room(source, guessed)
    source = _to_centimetres(with_stop_lines(source, lane_map, named, guessed))
    source = _decided(source, lane_map, named, guessed)
    guessed += [
        f'lane "{one}": only {length_of(source.lanes[one]):.0f} m before the junction: too short for who queues there'
        for one in dict.fromkeys(route.approach[0] for route in source.routes)
        if len(_chain(source, one)) == 1 and length_of(source.lanes[one]) < SHORT
    ]
    return Imported(source, circle, guessed, counts)


def _usable(lane_map: LaneMap, name: str, circles: Sequence[Circle]) -> list[Circle]:
    """Of the junctions with most crossings, those of which a source can be made.

    Raises:
        ValueError: of none; the message says why of each.
    """
    found, refused = [], []
    for circle in circles[:OFFERED]:
        try:
            compile_map(source_of(lane_map, name, circle).source)
        except ValueError as error:
            refused.append(f"around {circle}: {error}")
            continue
        found.append(circle)
    if not found:
        raise ValueError("\n  ".join([f"{len(circles)} junctions are on this map, and none can be used:", *refused]))
    return found


def _loose_joints(lane_map: LaneMap, ways: Mapping[str, Way]) -> list[str]:
    """Where ways lead over joints that the map does not draw."""
    found: dict[tuple[str, str], list[str]] = {}
    for id, way in ways.items():
        chain = [one.rstrip("+") for one in (*way.approach, *way.inside, *way.leaving)]
        for pair in pairwise(chain):
            if pair in lane_map.loose:
                found.setdefault(pair, []).append(id)
    return [
        f"lanelet {one} leads into {other}, though only one of their bounds does (routes {', '.join(ids)})"
        for (one, other), ids in found.items()
    ]


def _named(arms: Sequence[ArmLanes], ways: Sequence[Way]) -> dict[str, Way]:
    """The ways by route id: "W-E", "W-E.2" for the next one to the left, and "W-W" for one that turns back."""
    entry = {id: (arm.name, place) for arm in arms for place, id in enumerate(arm.approaches)}
    leave = {id: (arm.name, place) for arm in arms for place, id in enumerate(arm.exits)}
    found: dict[str, Way] = {}
    for way in sorted(ways, key=lambda one: (entry[one.approach[-1]], leave[one.leaving[0]])):
        a, b = entry[way.approach[-1]][0], leave[way.leaving[0]][0]
        same = sum(id == f"{a}-{b}" or id.startswith(f"{a}-{b}.") for id in found)
        found[f"{a}-{b}.{same + 1}" if same else f"{a}-{b}"] = way
    return found


def _rights(
    lane_map: LaneMap, arms: Sequence[ArmLanes], ways: Mapping[str, Way], ring: frozenset[str], guessed: list[str]
) -> dict[str, str]:
    """By arm, its right of way; around a ring who circulates goes first, whatever signs say."""
    entering = arms_of_ring(arms, ways, ring)
    others = {id: way for id, way in ways.items() if id.partition("-")[0] not in entering}
    if entering:
        guessed.append(
            f"roundabout: lanelets go round inside; who circulates goes before {', '.join(sorted(entering))}"
        )
    rest = rights_of_arms(lane_map, [arm for arm in arms if arm.name not in entering], others, guessed)
    return rest | dict.fromkeys(entering, "roundabout")


def _limit(lane_map: LaneMap, arm: ArmLanes, ways: Mapping[str, Way], guessed: list[str]) -> float:
    """An arm's speed limit [m/s]: the highest of its lanes."""
    ids = {id for name, way in ways.items() if name.partition("-")[0] == arm.name for id in way.approach}
    ids |= {id for way in ways.values() if way.leaving[0] in arm.exits for id in way.leaving}
    limits = [limit for id in sorted(ids) if (limit := lane_map.lanelets[id].speed_limit) is not None]
    if limits:
        return max(limits)
    guessed.append(f'arm "{arm.name}": {LIMIT:g} km/h, for the file says no limit')
    return LIMIT / 3.6


def _lanes(
    lane_map: LaneMap, arms: Sequence[ArmLanes], ways: Mapping[str, Way], ring: frozenset[str]
) -> tuple[dict[str, Lane], list[RouteSource]]:
    """Lanes and routes of the source. Lanelets that always follow each other become one lane; of those inside the
    junction, those that go round."""
    entry = {id: arm.name for arm in arms for id in arm.approaches}
    leave = {id: arm.name for arm in arms for id in arm.exits}
    lanes: dict[str, Lane] = {}
    names: dict[tuple[str, ...], str] = {}
    cut = {id: around(way, ring) for id, way in ways.items()}
    chains = {part for id, way in ways.items() for part in ((cut[id] or way).approach, (cut[id] or way).leaving)}
    chains |= {way.inside for way in cut.values() if way is not None}
    parts = {chain: _parts(chain, chains) for chain in sorted(chains)}

    def named(chain: tuple[str, ...], arm: str, direction: str) -> tuple[str, ...]:
        for part in parts[chain]:
            if part not in names:
                count = sum(one.startswith(f"{arm}_{direction}") for one in lanes)
                names[part] = f"{arm}_{direction}" if not count else f"{arm}_{direction}{count + 1}"
                points, width = polyline(lane_map, part)
                kept = telling(points)
                lanes[names[part]] = Lane(points[kept], width[kept])
        return tuple(names[part] for part in parts[chain])

    routes = []
    for id, way in ways.items():
        arm, parts_of = (entry[way.approach[-1]], leave[way.leaving[0]]), cut[id] or way
        approach, leaving = named(parts_of.approach, arm[0], "in"), named(parts_of.leaving, arm[1], "out")
        if cut[id] is None:
            points, width = polyline(lane_map, way.inside)
            bent = least_bent(points, room_of(width))
            inside = bent[telling(bent)]
            routes.append(RouteSource(id, *arm, approach, leaving, inside))
        else:
            interior = named(parts_of.inside, "ring", "lane")
            routes.append(RouteSource(id, *arm, approach, leaving, None, interior))
    return lanes, routes


def _parts(chain: tuple[str, ...], chains: set[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """The chain, cut where another one leaves or ends: each part is in a chain whole or not at all."""
    parts: list[list[str]] = []
    before: set[tuple[str, ...]] = set()
    for id in chain:
        users = {one for one in chains if id in one}
        if parts and users == before:
            parts[-1].append(id)
        else:
            parts.append([id])
        before = users
    return tuple(map(tuple, parts))


def _to_centimetres(source: MapSource) -> MapSource:
    """The source as its file holds it: what is decided and compiled now is so when it is read, too."""
    lanes = {name: Lane(_rounded(lane.points), _rounded(lane.width)) for name, lane in source.lanes.items()}
    lines = {name: _rounded(line) for name, line in source.stop_lines.items()}
    routes = [one if one.inside is None else replace(one, inside=_rounded(one.inside)) for one in source.routes]
    return replace(source, lanes=lanes, stop_lines=lines, routes=tuple(routes))


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.round(values, 2) + 0.0)  # adding 0 leaves no -0.0


def _decided(source: MapSource, lane_map: LaneMap, ways: Mapping[str, Way], guessed: list[str]) -> MapSource:
    """The source with `yields` for pairs of which the map's rules say otherwise than the arms, or nobody says."""
    pairs: set[tuple[str, str]] = set()
    for one in encounters(source):
        first, second = one.first.id, one.second.id
        circulates = all(source.arms[route.entry].right_of_way == "roundabout" for route in (one.first, one.second))
        said = None if circulates else yields_by_rule(lane_map, ways[first], ways[second])
        if said is not None and said != one.first_yields:
            pairs.add((first, second) if said else (second, first))
        elif said is None and one.first_yields is None:
            waits = _who_waits(source, one)
            if waits in pairs or waits[::-1] in pairs:
                continue
            pairs.add(waits)
            guessed.append(f'"{waits[0]}" waits for "{waits[1]}": equal right of way, neither from the right')
    return replace(source, yields=frozenset(pairs))


def _who_waits(source: MapSource, pair: Encounter) -> tuple[str, str]:
    """Of a pair that no rule orders: who turns waits for who runs straight, else the second for the first."""
    first, second = pair.first.id, pair.second.id
    if source.turn(pair.first) != "straight" and source.turn(pair.second) == "straight":
        return first, second
    return second, first


def _chain(source: MapSource, first: str) -> tuple[str, ...]:
    return next(route.approach for route in source.routes if route.approach[0] == first)
