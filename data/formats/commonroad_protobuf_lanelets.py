"""Lanelets and signs of CommonRoad's protobuf files as elements of the XML format."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from data.formats.xml_leaves import leaf, points, references, words

TYPES = (
    "urban", "country", "highway", "driveWay", "mainCarriageWay", "accessRamp", "exitRamp", "shoulder", "busLane",
    "busStop", "bicycleLane", "sidewalk", "crosswalk", "interstate", "intersection", "border", "parking", "restricted",
)  # fmt: skip
"""XML's words for lanelets, by the numbers that protobuf has for them. What 18 and 19 mean depends on the version."""
USERS = (
    "vehicle", "car", "truck", "bus", "priorityVehicle", "motorcycle", "bicycle", "pedestrian", "train", "taxi",
)  # fmt: skip
"""XML's words for road users, by number."""

Signs = Mapping[str, Mapping[int, str]]
"""By country, the ids that XML has for signs, by number; only of signs that maps are read for."""
GERMAN = {16: "205", 17: "206", 57: "274", 58: "274.1", 70: "301", 71: "306"}
OF_SCENARIOS: Signs = {
    "germany": GERMAN, "zamunda": GERMAN, "usa": {0: "R2-1"}, "puerto_rico": {0: "R2-1"}, "china": {0: "274"},
    "italy": {0: "274"},
}  # fmt: skip
OF_MAPS: Signs = {
    "DEU": GERMAN, "ZAM": GERMAN, "USA": {17: "R1-1", 57: "R2-1", 241: "R1-3"}, "PRI": {57: "R2-1"},
    "AUS": {16: "R1-2", 17: "R1-1"}, "CHN": {57: "274"}, "ITA": {57: "274"},
}  # fmt: skip
COUNTRIES = (*OF_MAPS, "ESP", "RUS", "ARG", "BEL", "FRA", "GRC", "HRV")
"""Others have the signs of Zamunda, CommonRoad's own country."""


def lanelets_of_scenario(root: Element, message: Any) -> None:
    """Adds the lanelets, signs and traffic lights of a scenario in one file.

    Lanelets hold their bounds and stop lines, and each country numbers its signs.
    """
    for one in message.lanelets:
        element = _lanelet(root, one)
        points(SubElement(element, "leftBound"), one.left_bound.points)
        points(SubElement(element, "rightBound"), one.right_bound.points)
        if one.HasField("stop_line"):
            line = SubElement(element, "stopLine")
            points(line, one.stop_line.points)
            references(line, "trafficSignRef", one.stop_line.traffic_sign_refs)
    for sign in message.traffic_signs:
        element = SubElement(root, "trafficSign", id=str(sign.traffic_sign_id))
        for part in sign.traffic_sign_elements:
            for field, number in part.ListFields():
                if field.name != "additional_values":
                    country = field.name.removesuffix("_element_id")
                    _sign(element, OF_SCENARIOS, country, number, part.additional_values)
    for _ in message.traffic_lights:
        SubElement(root, "trafficLight")


def lanelets_of_map(path: Path, root: Element, message: Any) -> None:
    """Adds the lanelets, signs, traffic lights and areas of a map.

    Lanelets name their bounds and stop lines, and a sign has one number in all countries, but an id in each.

    Raises:
        ValueError: a bound or a stop line is not there.
    """
    bounds = {one.boundary_id: one.points for one in message.boundaries}
    lines = {one.stop_line_id: one for one in message.stop_lines}
    for one in message.lanelets:
        element = _lanelet(root, one)
        where = f"{path}: lanelet {one.lanelet_id}"
        for side in ("left", "right"):
            id = getattr(one, f"{side}_bound")
            if id not in bounds:
                raise ValueError(f"{where}: {side}_bound is {id}; wanted the id of one of the boundaries")
            turned = getattr(one, f"{side}_bound_reverse")
            points(SubElement(element, f"{side}Bound"), bounds[id][::-1] if turned else bounds[id])
        if one.HasField("stop_line"):
            if one.stop_line not in lines:
                raise ValueError(f"{where}: stop_line is {one.stop_line}; wanted the id of one of the stop_lines")
            line = lines[one.stop_line]
            points(SubElement(element, "stopLine"), (line.start_point, line.end_point))
    named = message.map_meta_information.map_id.country_id.decode(errors="replace")
    country = named if named in COUNTRIES else "ZAM"
    for sign in message.traffic_signs:
        element = SubElement(root, "trafficSign", id=str(sign.traffic_sign_id))
        for part in sign.traffic_sign_elements:
            _sign(element, OF_MAPS, country, part.element_id, part.additional_values)
    for tag, found in (("trafficLight", message.traffic_lights), ("area", message.areas)):
        for _ in found:
            SubElement(root, tag)


def _lanelet(root: Element, one: Any) -> Element:
    element = SubElement(root, "lanelet", id=str(one.lanelet_id))
    references(element, "successor", one.successors)
    references(element, "trafficSignRef", one.traffic_sign_refs)
    words(element, "laneletType", TYPES, one.lanelet_types)
    words(element, "userOneWay", USERS, one.user_one_way)
    words(element, "userBidirectional", USERS, one.user_bidirectional)
    return element


def _sign(sign: Element, ids: Signs, country: str, number: int, values: Iterable[bytes]) -> None:
    element = SubElement(sign, "trafficSignElement")
    leaf(element, "trafficSignID", ids.get(country, {}).get(number, f"number {number} ({country})"))
    for value in values:
        leaf(element, "additionalValue", value.decode(errors="replace"))
