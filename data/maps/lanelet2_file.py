"""Reads the lanelets of a Lanelet2 map (.osm), in local metres.

Read as XML, not with the lanelet2 library: its reader drops right-of-way elements that it cannot parse whole (inD's
location 2), gives 50 km/h where a map says no limit, and its routing graph crashes on lanelets that are drawn badly.
Source: Lanelet2, "Lanelet primitives", "Linestring tagging" and "Regulatory elements".
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from data.formats.xml_tree import number, read_xml
from data.maps.bounds import distinct, facing, follow_each_other, joined, with_loose_joints
from data.maps.lanelets import Lanelet, LaneMap, RightOfWay
from data.maps.speed_limit import speed_limit
from data.maps.utm import utm, zone_of
from intersection_env.maps.curve import Points

CARS = ("road", "highway", "play_street", "emergency_lane")
SIGNS = {
    "de205": "yield",
    "de206": "stop",
    "de301": "priority",
    "de306": "priority",
    "usR1-1": "stop",
    "usR1-2": "yield",
}
NEAR_ZERO = 0.1  # [degrees], ours: INTERACTION projects its metres to places around 0, 0
ROUND_ORIGIN = 100.0  # [m], ours: an origin that nobody stated is rounded to this
LINE_OF_LANE = 4.0  # [m], ours: a stop line belongs to the lanelet that ends within this


class _File(NamedTuple):
    """What the file holds, by id; points in local metres."""

    path: Path
    nodes: dict[str, Points]
    ways: dict[str, Element]
    relations: dict[str, Element]

    def line(self, where: str, way: str) -> Points:
        """(point, 2) [m]."""
        if way not in self.ways:
            raise ValueError(f"{where}: way {way} is not in the file")
        ids = [one.get("ref", "") for one in self.ways[way].findall("nd")]
        missing = [id for id in ids if id not in self.nodes]
        if missing:
            raise ValueError(f"{where}: node {missing[0]} of way {way} is not in the file")
        return distinct(where, [self.nodes[id] for id in ids])


def read_lanelet2(path: Path, origin: tuple[float, float] | None = None) -> LaneMap:
    """The lanelets of a file on which cars drive.

    origin: UTM coordinates of the local 0, 0 [m], as inD's xUtmOrigin and yUtmOrigin; without it that of
    INTERACTION's files around 0 degrees, or a guess.

    Raises:
        ValueError: the file is no Lanelet2 map, or a lanelet is malformed; the message names it.
        OSError: the file cannot be read.
    """
    root = read_xml(path, "osm")
    nodes, words = _local(path, root, origin)
    by_id = [{one.get("id", ""): one for one in root.findall(kind)} for kind in ("way", "relation")]
    file = _File(path, nodes, *by_id)
    left_out: Counter[str] = Counter()
    ignored: Counter[str] = Counter()
    elements = {id: one for id, one in file.relations.items() if tags(one).get("type") == "regulatory_element"}
    found: dict[str, Lanelet] = {}
    for id, relation in file.relations.items():
        kind = tags(relation).get("type", "relation without a type")
        if kind == "lanelet":
            why = _no_cars(tags(relation))
            if why:
                left_out[why] += 1
            else:
                found |= {one.id: one for one in _lanelets(file, id, relation, elements)}
        elif kind not in ("regulatory_element", "multipolygon"):
            ignored[kind] += 1
    if not found:
        raise ValueError(f"{path}: no lanelet on which cars drive")
    found, loose = with_loose_joints(follow_each_other(found))
    rights = _rights(file, elements, found, ignored)
    return LaneMap(found, rights, left_out, +ignored, loose, words)


def tags(element: Element) -> dict[str, str]:
    """The tags of a node, way or relation."""
    return {one.get("k", ""): one.get("v", "") for one in element.findall("tag")}


def _local(path: Path, root: Element, origin: tuple[float, float] | None) -> tuple[dict[str, Points], str]:
    """The nodes in local metres by id, and what was subtracted, in words."""
    nodes = root.findall("node")
    if not nodes:
        raise ValueError(f"{path}: no nodes; wanted a Lanelet2 map")
    degrees = np.array(
        [[number(f"{path}: node {one.get('id')}, {axis}", one.get(axis)) for axis in ("lat", "lon")] for one in nodes]
    )
    if (np.abs(degrees) > [90.0, 180.0]).any():
        worst = nodes[int(np.argmax((np.abs(degrees) > [90.0, 180.0]).any(axis=1)))]
        raise ValueError(f"{path}: node {worst.get('id')} lies at {worst.get('lat')}, {worst.get('lon')} degrees")
    zone = zone_of(float(np.median(degrees[:, 1])))
    metres = utm(degrees[:, 0], degrees[:, 1], zone)
    stated = "as given"
    if origin is None and np.abs(degrees).max() < NEAR_ZERO:
        zone = zone_of(0.0)
        metres = utm(degrees[:, 0], degrees[:, 1], zone)
        origin, stated = tuple(utm(np.zeros(1), np.zeros(1), zone)[0].tolist()), "of 0, 0 degrees, as INTERACTION's"
    elif origin is None:
        guess = np.round(np.median(metres, axis=0) / ROUND_ORIGIN) * ROUND_ORIGIN
        origin, stated = tuple(guess.tolist()), "guessed: the middle of the map; give the recordings' (--origin)"
    local = metres - np.array(origin)
    words = f"UTM zone {zone} less {origin[0]:.2f}, {origin[1]:.2f} m ({stated})"
    return {one.get("id", ""): place for one, place in zip(nodes, local, strict=True)}, words


def _no_cars(tag: Mapping[str, str]) -> str | None:
    """Why no car drives on a lanelet, or None: what is said of participants goes before the subtype."""
    subtype = tag.get("subtype", "")
    said = {key: value for key, value in tag.items() if key.split(":")[0] == "participant"}
    for key in ("participant:vehicle:car", "participant:vehicle", "participant"):
        if key in said:
            return None if said[key] == "yes" else f"{subtype} without cars"
    if "yes" in said.values():
        who = sorted(key.partition(":")[2] for key, value in said.items() if value == "yes")
        return f"lane of {', '.join(who)}"
    return None if subtype in CARS else subtype.replace("_", " ") or "without a subtype"


def _lanelets(file: _File, id: str, relation: Element, elements: Mapping[str, Element]) -> Iterable[Lanelet]:
    """A lanelet, and where both directions may use it the one back."""
    where = f"{file.path}: lanelet {id}"
    bounds = {}
    for side in ("left", "right"):
        ways = [one.get("ref", "") for one in relation.findall("member") if one.get("role") == side]
        place = f"{where}, {side} bound"
        bounds[side] = joined(place, [file.line(place, way) for way in ways])
    left, right = facing(bounds["left"], bounds["right"])
    tag = tags(relation)
    own = [
        tags(elements[ref]) | _refers(file, elements[ref])
        for ref in _refs(relation, "regulatory_element")
        if ref in elements
    ]
    limit = tag.get("speed_limit") or next((one["limit"] for one in own if "limit" in one), None)
    signs = {SIGNS[one["sign"]] for one in own if one.get("subtype") == "traffic_sign" and one.get("sign") in SIGNS}
    one = Lanelet(
        id,
        left,
        right,
        speed_limit=None if limit is None else speed_limit(where, limit, "km/h"),
        signs=frozenset(signs),
    )
    yield one
    if tag.get("one_way") == "no":
        yield replace(one, id=f"{id}-", left=right[::-1], right=left[::-1])


def _refs(relation: Element, *roles: str) -> list[str]:
    return [one.get("ref", "") for one in relation.findall("member") if one.get("role") in roles]


def _refers(file: _File, element: Element) -> dict[str, str]:
    """What the signs of a regulatory element say: "sign", its kind, and "limit", its speed."""
    found: dict[str, str] = {}
    names = [tags(element).get("sign_type", "")]
    names += [tags(file.ways[ref]).get("subtype", "") for ref in _refs(element, "refers") if ref in file.ways]
    for name in filter(None, names):
        match = re.fullmatch(r"de274[.-]?(\d+)", name)
        found |= {"limit": match[1]} if match else {"sign": name}
    if tags(element).get("subtype") == "speed_limit" and "speed_limit" in tags(element):
        found["limit"] = tags(element)["speed_limit"]
    return found


def _rights(
    file: _File, elements: Mapping[str, Element], found: dict[str, Lanelet], ignored: Counter[str]
) -> list[RightOfWay]:
    """The right-of-way elements; stop lines go to the lanelets that end there."""
    rights = []
    for element in elements.values():
        kind = tags(element).get("subtype", "without a subtype")
        if kind in ("traffic_sign", "speed_limit"):
            continue
        if kind not in ("right_of_way", "all_way_stop"):
            ignored[f"regulatory element {kind}"] += 1
            continue
        yields = [id for id in _refs(element, "yield") if id in found]
        prior = [id for id in _refs(element, "right_of_way") if id in found]
        named = [id for id in _refs(element, "yield", "right_of_way") if id not in found]
        missing = sum(id not in file.relations for id in named)
        ignored["lanelet of a right of way that is not in the file"] += missing
        ignored["lanelet of a right of way on which no car drives"] += len(named) - missing
        stops = kind == "all_way_stop" or _refers(file, element).get("sign") in [
            name for name, sign in SIGNS.items() if sign == "stop"
        ]
        if kind == "all_way_stop":
            for id in yields:
                found[id] = replace(found[id], signs=found[id].signs | {"all_way_stop"})
        else:
            rights.append(RightOfWay(frozenset(yields), frozenset(prior), stops))
        for ref in _refs(element, "ref_line"):
            line = file.line(f"{file.path}: right of way, ref_line", ref)
            _draw(found, yields, line[[0, -1]])
    return rights


def _draw(found: dict[str, Lanelet], yields: Iterable[str], line: Points) -> None:
    """A painted line goes to the lanelets that end there."""
    middle = line.mean(axis=0)
    for id in yields:
        if np.linalg.norm(found[id].centre()[0][-1] - middle) < LINE_OF_LANE:
            found[id] = replace(found[id], stop_line=line)
