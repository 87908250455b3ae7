"""Reads CommonRoad's protobuf files as the tree that the same scenario has in XML, so that one reader reads both.

Source: the messages that commonroad-io 2024.3 (one file) and 2026.1 (map, dynamic part and problems a file each) write.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from data.formats.commonroad_parts import DYNAMIC, MAP, SCENARIO, read_part
from data.formats.commonroad_protobuf_lanelets import lanelets_of_map, lanelets_of_scenario
from data.formats.xml_leaves import leaf, place, points, words

TYPES = (
    "unknown", "car", "truck", "bus", "bicycle", "pedestrian", "priorityVehicle", "parkedVehicle", "constructionZone",
    "train", "roadBoundary", "motorcycle", "taxi", "building", "pillar", "median_strip", "vehicle",
)  # fmt: skip
"""XML's words for obstacles, by the numbers that protobuf has for them."""
VALUES = {"time_step": "time", "orientation": "orientation", "velocity": "velocity", "acceleration": "acceleration"}
"""By the field of a state, XML's word."""


def read_protobuf(path: Path) -> Element:
    """The root element that the file's scenario, or part of one, has in XML.

    Raises:
        ValueError: the file is none, is truncated, lacks something or contradicts itself; the message names it.
        OSError: the file cannot be read.
    """
    holds, message = read_part(path)
    root = Element("commonRoad")
    if holds == SCENARIO:
        _head(root, message.information.common_road_version, message.information.time_step_size)
        lanelets_of_scenario(root, message)
        _obstacles(root, message)
    elif holds == MAP:
        lanelets_of_map(path, root, message)
    elif holds == DYNAMIC:
        head = message.dynamic_meta_information
        _head(root, head.benchmark_id.scenario_version, head.time_step_size)
        _obstacles(root, message)
    return root


def _head(root: Element, version: bytes, time_step: float) -> None:
    root.set("commonRoadVersion", version.decode(errors="replace"))
    root.set("timeStepSize", repr(time_step))


def _obstacles(root: Element, message: Any) -> None:
    for one in message.static_obstacles:
        _body(SubElement(root, "staticObstacle", id=str(one.static_obstacle_id)), one)
    for one in message.dynamic_obstacles:
        element = SubElement(root, "dynamicObstacle", id=str(one.dynamic_obstacle_id))
        _body(element, one)
        if one.HasField("trajectory_prediction"):
            trajectory = SubElement(element, "trajectory")
            for state in one.trajectory_prediction.trajectory.states:
                _state(SubElement(trajectory, "state"), state)
        if one.HasField("set_based_prediction"):
            SubElement(element, "occupancySet")


def _body(element: Element, one: Any) -> None:
    words(element, "type", TYPES, [one.obstacle_type])
    _shape(SubElement(element, "shape"), one.shape)
    _state(SubElement(element, "initialState"), one.initial_state)


def _shape(element: Element, shape: Any) -> None:
    if shape.HasField("rectangle"):
        own = SubElement(element, "rectangle")
        leaf(own, "length", shape.rectangle.length)
        leaf(own, "width", shape.rectangle.width)
        if _has(shape.rectangle, "orientation"):
            leaf(own, "orientation", shape.rectangle.orientation)
        _centre(own, shape.rectangle)
    if shape.HasField("circle"):
        own = SubElement(element, "circle")
        leaf(own, "radius", shape.circle.radius)
        _centre(own, shape.circle)
    if shape.HasField("polygon"):
        points(SubElement(element, "polygon"), shape.polygon.vertices)
    if _has(shape, "truck_shape"):
        own = SubElement(element, "rectangle")
        leaf(own, "length", shape.truck_shape.truck_dims.length)
        leaf(own, "width", shape.truck_shape.truck_dims.width)
        centre = SubElement(own, "center")
        leaf(centre, "x", -shape.truck_shape.origin_x_shift)  # which is the origin's, seen from the middle
        leaf(centre, "y", 0.0)


def _centre(element: Element, shape: Any) -> None:
    if _has(shape, "center"):
        place(SubElement(element, "center"), shape.center)


def _state(element: Element, state: Any) -> None:
    if state.HasField("point"):
        place(SubElement(SubElement(element, "position"), "point"), state.point)
    for name, word in VALUES.items():
        if not state.HasField(name):
            continue
        value, own = getattr(state, name), SubElement(element, word)
        if value.HasField("exact"):
            leaf(own, "exact", value.exact)
        elif value.HasField("interval"):
            leaf(own, "intervalStart", value.interval.start)
            leaf(own, "intervalEnd", value.interval.end)


def _has(message: Any, field: str) -> bool:
    """Whether a field is there; one of the two layouts does not know it."""
    return field in message.DESCRIPTOR.fields_by_name and message.HasField(field)
