"""CommonRoad scenarios that tests wrote as XML, written again as protobuf."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from data.formats.commonroad_messages import ONE_FILE, classes
from data.formats.commonroad_protobuf import TYPES
from data.formats.commonroad_protobuf_lanelets import GERMAN
from data.formats.commonroad_protobuf_lanelets import TYPES as LANELET_TYPES
from data.formats.commonroad_tree import read_tree
from data.formats.xml_tree import number, text_of


def write_protobuf(source: Path, path: Path) -> None:
    """Writes what the XML files of `write_commonroad` and `write_commonroad_map` hold, as one file."""
    root = read_tree(source)
    message = classes("written", ONE_FILE)["CommonRoad"]()
    message.information.common_road_version = root.get("commonRoadVersion", "").encode()
    message.information.time_step_size = float(root.get("timeStepSize", ""))
    for element in root.findall("lanelet"):
        _lanelet(message.lanelets.add(), element)
    for element in root.findall("trafficSign"):
        sign = message.traffic_signs.add(traffic_sign_id=int(element.get("id", "")))
        part = sign.traffic_sign_elements.add()
        kind = text_of(element, "trafficSignElement/trafficSignID")
        part.germany_element_id = next(number for number, id in GERMAN.items() if id == kind)
        value = text_of(element, "trafficSignElement/additionalValue")
        part.additional_values.extend([] if value is None else [value.encode()])
    for element in root.findall("dynamicObstacle"):
        _obstacle(message.dynamic_obstacles.add(), element)
    path.write_bytes(message.SerializeToString())


def _lanelet(message: Any, element: Element) -> None:
    message.lanelet_id = int(element.get("id", ""))
    for bound, tag in ((message.left_bound, "leftBound"), (message.right_bound, "rightBound")):
        for point in element.findall(f"{tag}/point"):
            bound.points.add(x=_number(point, "x"), y=_number(point, "y"))
    message.successors.extend(int(one.get("ref", "")) for one in element.findall("successor"))
    message.traffic_sign_refs.extend(int(one.get("ref", "")) for one in element.findall("trafficSignRef"))
    message.lanelet_types.extend(LANELET_TYPES.index(one.text or "") for one in element.findall("laneletType"))


def _obstacle(message: Any, element: Element) -> None:
    message.dynamic_obstacle_id = int(element.get("id", ""))
    message.obstacle_type = TYPES.index(text_of(element, "type") or "")
    for name in ("length", "width"):
        setattr(message.shape.rectangle, name, _number(element, f"shape/rectangle/{name}"))
    _state(message.initial_state, element.find("initialState"))
    for state in element.findall("trajectory/state"):
        _state(message.trajectory_prediction.trajectory.states.add(), state)


def _state(message: Any, element: Element | None) -> None:
    assert element is not None
    message.point.x, message.point.y = (_number(element, f"position/point/{axis}") for axis in ("x", "y"))
    message.time_step.exact = int(_number(element, "time/exact"))
    for name in ("orientation", "velocity", "acceleration"):
        getattr(message, name).exact = _number(element, f"{name}/exact")


def _number(element: Element, path: str) -> float:
    return number(path, text_of(element, path))
