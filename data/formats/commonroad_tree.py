"""A CommonRoad file, XML or protobuf, as the tree of its XML."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from data.formats.commonroad_parts import DYNAMIC, SCENARIO, read_part
from data.formats.commonroad_protobuf import read_protobuf
from data.formats.xml_tree import read_xml

XML, PROTOBUF = ".xml", ".pb"
VERSIONS = ("2018b", "2020a")
"""Of the XML format; those who write three protobuf files call them 2020a, too."""


def read_tree(path: Path) -> Element:
    """The root element of a scenario, or of a part of one.

    Raises:
        ValueError: the file is no CommonRoad file, is damaged, or is of another version.
        OSError: the file cannot be read.
    """
    root = read_protobuf(path) if path.suffix == PROTOBUF else read_xml(path, "commonRoad")
    version = root.get("commonRoadVersion")
    if version is not None and version not in VERSIONS:
        raise ValueError(f'{path}: CommonRoad version "{version}"; wanted {" or ".join(VERSIONS)}')
    return root


def has_obstacles(path: Path) -> bool:
    """Whether a file is one that holds obstacles: a scenario, not a map or planning problems on their own.

    Raises:
        ValueError, OSError: as `read_tree`, for protobuf.
    """
    return path.suffix == XML or (path.suffix == PROTOBUF and read_part(path).holds in (SCENARIO, DYNAMIC))
