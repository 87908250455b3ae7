"""The messages of CommonRoad's protobuf files, as far as they are read, built from names and numbers of their fields.

Two layouts exist. One file holds a scenario whole (commonroad-io 2022.2 to 2024.3, which changed nothing that is read
here); or map, dynamic part (obstacles) and planning problems are a file each (commonroad-io 2026.1). What a file holds
beside this is skipped, as protobuf does with fields that it does not know. Enumerations are read as their numbers.
"""

from __future__ import annotations

from typing import Any

from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass

Messages = dict[str, tuple[FieldDescriptorProto, ...]]
"""By a message's name, its fields."""
SCALARS = {
    "double": FieldDescriptorProto.TYPE_DOUBLE,
    "bool": FieldDescriptorProto.TYPE_BOOL,
    "int32": FieldDescriptorProto.TYPE_INT32,
    "uint32": FieldDescriptorProto.TYPE_UINT32,
    "text": FieldDescriptorProto.TYPE_BYTES,  # strings, too: one that is no UTF-8 is no reason to refuse a file
}


def must(name: str, number: int, kind: str) -> FieldDescriptorProto:
    """A field that has to be there; kind: of `SCALARS`, or a message's name."""
    return _field(name, number, kind, FieldDescriptorProto.LABEL_REQUIRED)


def may(name: str, number: int, kind: str) -> FieldDescriptorProto:
    """A field that may be there."""
    return _field(name, number, kind, FieldDescriptorProto.LABEL_OPTIONAL)


def many(name: str, number: int, kind: str) -> FieldDescriptorProto:
    """A field that may be there several times."""
    return _field(name, number, kind, FieldDescriptorProto.LABEL_REPEATED)


def _field(name: str, number: int, kind: str, label: int) -> FieldDescriptorProto:
    if kind in SCALARS:
        return FieldDescriptorProto(name=name, number=number, label=label, type=SCALARS[kind])
    message = FieldDescriptorProto.TYPE_MESSAGE
    return FieldDescriptorProto(name=name, number=number, label=label, type=message, type_name=kind)


BOTH: Messages = {
    "Point": (must("x", 1, "double"), must("y", 2, "double")),
    "FloatInterval": (must("start", 1, "double"), must("end", 2, "double")),
    "IntegerInterval": (must("start", 1, "int32"), must("end", 2, "int32")),
    "Float": (may("exact", 1, "double"), may("interval", 2, "FloatInterval")),
    "Integer": (may("exact", 1, "int32"), may("interval", 2, "IntegerInterval")),
    "Polygon": (many("vertices", 1, "Point"),),
    "State": (
        may("point", 1, "Point"),
        may("orientation", 3, "Float"),
        may("velocity", 4, "Float"),
        may("acceleration", 34, "Float"),
        must("time_step", 39, "Integer"),
    ),
    "Trajectory": (many("states", 2, "State"),),
    "TrajectoryPrediction": (must("trajectory", 1, "Trajectory"),),
    "Unread": (),
    "DynamicObstacle": (
        must("dynamic_obstacle_id", 1, "uint32"),
        must("obstacle_type", 2, "int32"),
        must("shape", 3, "Shape"),
        must("initial_state", 4, "State"),
        may("trajectory_prediction", 5, "TrajectoryPrediction"),
        may("set_based_prediction", 6, "Unread"),
    ),
    "StaticObstacle": (
        must("static_obstacle_id", 1, "uint32"),
        must("obstacle_type", 2, "int32"),
        must("shape", 3, "Shape"),
        must("initial_state", 4, "State"),
    ),
}
ONE_FILE: Messages = BOTH | {
    "Rectangle": (
        must("length", 1, "double"),
        must("width", 2, "double"),
        may("center", 3, "Point"),
        may("orientation", 4, "double"),
    ),
    "Circle": (must("radius", 1, "double"), may("center", 2, "Point")),
    "Shape": (may("rectangle", 1, "Rectangle"), may("circle", 2, "Circle"), may("polygon", 3, "Polygon")),
    "Bound": (many("points", 1, "Point"),),
    "StopLine": (many("points", 1, "Point"), many("traffic_sign_refs", 3, "uint32")),
    "Lanelet": (
        must("lanelet_id", 1, "uint32"),
        must("left_bound", 2, "Bound"),
        must("right_bound", 3, "Bound"),
        many("successors", 5, "uint32"),
        may("stop_line", 10, "StopLine"),
        many("lanelet_types", 11, "int32"),
        many("user_one_way", 12, "int32"),
        many("user_bidirectional", 13, "int32"),
        many("traffic_sign_refs", 14, "uint32"),
    ),
    "TrafficSignElement": (
        may("germany_element_id", 1, "int32"),
        may("zamunda_element_id", 2, "int32"),
        may("usa_element_id", 3, "int32"),
        may("china_element_id", 4, "int32"),
        may("spain_element_id", 5, "int32"),
        may("russia_element_id", 7, "int32"),
        may("argentina_element_id", 8, "int32"),
        may("belgium_element_id", 9, "int32"),
        may("france_element_id", 10, "int32"),
        may("greece_element_id", 11, "int32"),
        may("croatia_element_id", 12, "int32"),
        may("italy_element_id", 13, "int32"),
        may("puerto_rico_element_id", 14, "int32"),
        many("additional_values", 15, "text"),
    ),
    "TrafficSign": (must("traffic_sign_id", 1, "uint32"), many("traffic_sign_elements", 2, "TrafficSignElement")),
    "ScenarioInformation": (must("common_road_version", 1, "text"), must("time_step_size", 7, "double")),
    "CommonRoad": (
        must("information", 1, "ScenarioInformation"),
        many("lanelets", 4, "Lanelet"),
        many("traffic_signs", 5, "TrafficSign"),
        many("traffic_lights", 6, "Unread"),
        many("static_obstacles", 8, "StaticObstacle"),
        many("dynamic_obstacles", 9, "DynamicObstacle"),
    ),
}
THREE_FILES: Messages = BOTH | {
    "Rectangle": (must("length", 1, "double"), must("width", 2, "double")),
    "Circle": (must("radius", 1, "double"),),
    "TruckDims": (must("length", 1, "double"), must("width", 2, "double")),
    "Truck": (must("truck_dims", 1, "TruckDims"), must("origin_x_shift", 2, "double")),
    "Shape": (
        may("rectangle", 1, "Rectangle"),
        may("circle", 2, "Circle"),
        may("polygon", 3, "Polygon"),
        may("truck_shape", 4, "Truck"),
    ),
    "MapID": (must("country_id", 1, "text"),),
    "MapInformation": (must("map_id", 1, "MapID"),),
    "ScenarioID": (must("scenario_version", 6, "text"),),
    "MetaInformation": (must("benchmark_id", 1, "ScenarioID"), must("time_step_size", 3, "double")),
    "Bound": (must("boundary_id", 1, "int32"), many("points", 2, "Point")),
    "StopLine": (must("stop_line_id", 1, "uint32"), must("start_point", 2, "Point"), must("end_point", 3, "Point")),
    "Lanelet": (
        must("lanelet_id", 1, "uint32"),
        must("left_bound", 2, "int32"),
        must("right_bound", 3, "int32"),
        may("left_bound_reverse", 4, "bool"),
        may("right_bound_reverse", 5, "bool"),
        many("successors", 7, "uint32"),
        may("stop_line", 12, "uint32"),
        many("lanelet_types", 13, "int32"),
        many("user_one_way", 14, "int32"),
        many("user_bidirectional", 15, "int32"),
        many("traffic_sign_refs", 16, "uint32"),
    ),
    "TrafficSignElement": (must("element_id", 1, "int32"), many("additional_values", 2, "text")),
    "TrafficSign": (must("traffic_sign_id", 1, "uint32"), many("traffic_sign_elements", 2, "TrafficSignElement")),
    "CommonRoadMap": (
        must("map_meta_information", 1, "MapInformation"),
        must("location", 2, "Unread"),
        many("lanelets", 3, "Lanelet"),
        many("stop_lines", 4, "StopLine"),
        many("boundaries", 5, "Bound"),
        many("areas", 6, "Unread"),
        many("traffic_signs", 7, "TrafficSign"),
        many("traffic_lights", 8, "Unread"),
    ),
    "CommonRoadDynamic": (
        must("dynamic_meta_information", 1, "MetaInformation"),
        must("environment", 2, "Unread"),
        many("static_obstacles", 5, "StaticObstacle"),
        many("dynamic_obstacles", 6, "DynamicObstacle"),
    ),
    "CommonRoadScenario": (
        must("scenario_meta_information", 1, "MetaInformation"),
        must("map_id", 3, "text"),
        must("dynamic_id", 4, "text"),
    ),
}


def classes(name: str, messages: Messages) -> dict[str, Any]:
    """By name, a class for each message; `name` is that of the layout, which stands in no file."""
    file = FileDescriptorProto(name=f"{name}.proto", package=name, syntax="proto2")
    for message, fields in messages.items():
        described = file.message_type.add(name=message)
        for one in fields:
            own = described.field.add()
            own.CopyFrom(one)
            if one.type_name:
                own.type_name = f".{name}.{one.type_name}"
    pool = DescriptorPool()
    pool.AddSerializedFile(file.SerializeToString())
    return {message: GetMessageClass(pool.FindMessageTypeByName(f"{name}.{message}")) for message in messages}
