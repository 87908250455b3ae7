"""Reads the lanelets of a CommonRoad map or scenario (XML of 2018b and 2020a, or protobuf).

XML is not read with commonroad-io: that truncates coordinates to four decimals, and what is needed of a map is
little. Source: CommonRoad, "XML scenario format", version 2020a.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from data.formats.commonroad_tree import PROTOBUF, read_tree
from data.formats.xml_tree import number, text_of
from data.maps.bounds import distinct, facing, follow_each_other, with_loose_joints
from data.maps.lanelets import Lanelet, LaneMap
from data.maps.speed_limit import speed_limit
from intersection_env.maps.curve import Points

SIGNS = {
    "205": "yield", "206": "stop", "301": "priority", "306": "priority",
    "R1-1": "stop", "R1-2": "yield", "R1-3": "stop",
}  # fmt: skip
"""Ids of traffic signs: German (StVO), and of the United States (MUTCD)."""
SPEED_LIMITS = ("274", "274.1", "R2-1")
CARS = ("car", "vehicle")
NO_CARS = {
    "busLane": "bus lane", "bicycleLane": "bicycle lane", "sidewalk": "walkway", "crosswalk": "crossing of walkers",
    "shoulder": "shoulder", "border": "border", "parking": "parking",
}  # fmt: skip
KNOWN = ("lanelet", "trafficSign", "location", "scenarioTags", "planningProblem", "dynamicObstacle", "staticObstacle",
         "obstacle", "intersection", "environmentObstacle", "phantomObstacle")  # fmt: skip
LIGHTS = "trafficLight"
MOST_JOINT = 10.0  # [m], ours: what begins farther from where a lanelet ends does not follow it, whatever the file says


def read_commonroad(path: Path) -> LaneMap:
    """The lanelets of a file on which cars drive.

    Raises:
        ValueError: the file is no CommonRoad file, or a lanelet is malformed; the message names it.
        OSError: the file cannot be read.
    """
    root = read_tree(path)
    ignored = Counter(one.tag for one in root if one.tag not in (*KNOWN, LIGHTS))
    ignored.update({"traffic light (a signal decides there, not the right of way)": len(root.findall(LIGHTS))})
    signs = {one.get("id", ""): one for one in root.findall("trafficSign")}
    kinds = {id: _kind(sign) for id, sign in signs.items()}
    ignored.update(f"traffic sign {kind}" for kind in kinds.values() if kind not in (*SIGNS, *SPEED_LIMITS))
    left_out: Counter[str] = Counter()
    found: dict[str, Lanelet] = {}
    for element in root.findall("lanelet"):
        id = element.get("id", "")
        if id in found:
            raise ValueError(f"{path}: lanelet {id} is there twice")
        why = _no_cars(element)
        if why:
            left_out[why] += 1
            continue
        drawn = _lanelet(f"{path}: lanelet {id}", id, element, signs, kinds)
        left, right = facing(drawn.left, drawn.right)
        if (left[0] != drawn.left[0]).any() or (right[0] != drawn.right[0]).any():
            ignored[f"direction in which the bounds of lanelet {id} are drawn: the left one is on the left"] += 1
        found[id] = replace(drawn, left=left, right=right)
    if not found:
        alone = path.suffix == PROTOBUF and not left_out
        where = "; where a scenario is three files, the map is one of its own" if alone else ""
        raise ValueError(f"{path}: no lanelet on which cars drive{where}")
    for id, one in found.items():
        known = tuple(other for other in one.successors if other in found)
        ignored["successor that is not there, or not for cars"] += len(one.successors) - len(known)
        away = {other: _away(one, found[other]) for other in known}
        ignored.update(
            f"successor {other} of lanelet {id}, for it begins {far:.0f} m from its end; is one drawn backwards?"
            for other, far in away.items()
            if far > MOST_JOINT
        )
        found[id] = replace(one, successors=tuple(other for other, far in away.items() if far <= MOST_JOINT))
    beside = follow_each_other(found)
    for id, one in found.items():
        if not one.successors and beside[id].successors:
            ignored["missing successor, taken from where lanelets end and begin"] += 1
            found[id] = beside[id]
    found, loose = with_loose_joints(found)
    return LaneMap(found, left_out=left_out, ignored=+ignored, loose=loose)


def _lanelet(where: str, id: str, element: Element, signs: dict[str, Element], kinds: dict[str, str]) -> Lanelet:
    bounds = [_points(f"{where}, {name}", element.find(name)) for name in ("leftBound", "rightBound")]
    line = element.find("stopLine")
    refers = [*element.findall("trafficSignRef"), *(line.findall("trafficSignRef") if line is not None else ())]
    own = [ref.get("ref", "") for ref in refers]
    own = [one for one in own if one in signs]
    limits = [speed_limit(where, _value(signs[one]), "m/s") for one in own if kinds[one] in SPEED_LIMITS]
    stop_line = None
    if line is not None:
        ends = line.findall("point")
        drawn = _points(f"{where}, stopLine", line) if len(ends) == 2 else np.array([one[-1] for one in bounds])
        stop_line = drawn
    return Lanelet(
        id=id,
        left=bounds[0],
        right=bounds[1],
        successors=tuple(dict.fromkeys(one.get("ref", "") for one in element.findall("successor"))),
        speed_limit=min(limits, default=None),
        signs=frozenset(SIGNS[kinds[one]] for one in own if kinds[one] in SIGNS),
        stop_line=stop_line,
    )


def _away(one: Lanelet, other: Lanelet) -> float:
    """How far from the end of a lanelet another one begins [m]."""
    ends, begins = one.left[-1] + one.right[-1], other.left[0] + other.right[0]
    return float(0.5 * np.linalg.norm(ends - begins))


def _points(where: str, element: Element | None) -> Points:
    if element is None:
        raise ValueError(f"{where} is missing")
    points = [[number(where, text_of(one, axis)) for axis in ("x", "y")] for one in element.findall("point")]
    return distinct(where, points)


def _no_cars(element: Element) -> str | None:
    """Why no car drives on a lanelet, or None."""
    for kind in element.findall("laneletType"):
        if (kind.text or "").strip() in NO_CARS:
            return NO_CARS[(kind.text or "").strip()]
    users = {(one.text or "").strip() for tag in ("userOneWay", "userBidirectional") for one in element.findall(tag)}
    if not users or users & set(CARS):
        return None
    return f"lane of {', '.join(sorted(users))}"


def _kind(sign: Element) -> str:
    one = sign.find("trafficSignElement")
    return "" if one is None else text_of(one, "trafficSignID") or ""


def _value(sign: Element) -> str | None:
    one = sign.find("trafficSignElement")
    return None if one is None else text_of(one, "additionalValue")
