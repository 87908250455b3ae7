"""What a map source says of ways inside the junction, of routes side by side, and of lanes that cannot be right."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from intersection_env.maps.compiler import compile_map, encounters
from intersection_env.maps.intersection import MAPS, XY, Intersection
from intersection_env.maps.source import MapSource

Change = Callable[[dict[str, Any]], object]


def changed(tmp_path: Path, change: Change) -> MapSource:
    """The T-junction's source, changed."""
    content = json.loads((MAPS / "t_junction.json").read_text(encoding="utf-8"))
    change(content)
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return MapSource.read(path)


def compiled(source: MapSource) -> Intersection:
    return Intersection(compile_map(source), "test")


def test_a_drawn_way_inside_is_driven_and_joined_to_its_lanes(tmp_path: Path) -> None:
    drawn = [[-10.0, -2.0], [0.0, -3.5], [10.0, -2.0]]  # its ends lie apart from the lanes', 1.65 and 1 m away
    source = changed(tmp_path, lambda content: content["routes"]["W-E"].update(inside=drawn))
    route = next(one for one in compiled(source).routes if one.id == "W-E")
    points = route.samples[:, XY]
    assert points[np.abs(points[:, 0]) < 1.0, 1].min() == pytest.approx(-3.15, abs=0.1)
    begin, end = (points[round(at)] for at in route.junction)
    assert begin == pytest.approx([-11.0, -1.65], abs=0.6)
    assert end == pytest.approx([11.0, -1.65], abs=0.6)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 1.01


def test_routes_side_by_side_are_numbered(tmp_path: Path) -> None:
    def beside(content: dict[str, Any]) -> None:
        for name, y in (("W_in2", -4.9), ("E_out2", -4.9)):
            first = content["lanes"][name[:-1]]
            content["lanes"][name] = {"width": 3.25, "points": [[x, y] for x, _ in first["points"]]}
        content["stop_lines"]["S_in"] = [[-6.0, -6.5], [8.0, -6.5]]
        content["routes"]["W-S"]["approach"] = ["W_in2"]
        content["routes"]["W-E.2"] = {"approach": ["W_in2"], "exit": ["E_out2"]}

    found = compiled(changed(tmp_path, beside))
    second = found.routes[found.route_index("W-E.2")]
    assert (second.entry, second.exit) == ("W", "E")
    assert {route.exit for route in found.routes} == {"W", "E", "S"}
    both = {found.route_index("W-E"), found.route_index("W-E.2")}
    assert not any({one.yielder, one.prioritized} == both for one in found.conflicts)


@pytest.mark.parametrize("name", ["W-E.x", "W-E.", "W-X.2"])
def test_a_route_of_another_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="must be named by two arms"):
        changed(tmp_path, lambda content: content["routes"].update({name: content["routes"]["W-E"]}))


def test_an_arm_with_a_dot_is_refused(tmp_path: Path) -> None:
    arm = {"right_of_way": "yield", "speed_limit_kmh": 50}
    with pytest.raises(ValueError, match=r'arm "S\.2" must be named by one word without "-" and'):
        changed(tmp_path, lambda content: content["arms"].update({"S.2": arm}))


def test_an_unknown_lane_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'route "W-E": "exit" must be a list of lanes, there is no lane .E_off. in'):
        changed(tmp_path, lambda content: content["routes"]["W-E"].update(exit=["E_off"]))


@pytest.mark.parametrize("lane", ["W_in", "E_in", "S_in", "S_in_outer", "E_out", "S_out", "S_out_outer"])
def test_a_lane_drawn_backwards_is_named(tmp_path: Path, lane: str) -> None:
    with pytest.raises(ValueError, match=rf'lane "{lane}" .*drawn backwards|drawn backwards, or .*lane "{lane}"'):
        changed(tmp_path, lambda content: content["lanes"][lane]["points"].reverse())


def test_a_way_inside_drawn_backwards_is_named(tmp_path: Path) -> None:
    drawn = [[10.0, -2.0], [0.0, -3.5], [-10.0, -2.0]]
    with pytest.raises(ValueError, match=r'route "W-E": .*"inside".*drawn backwards|"inside" is drawn backwards'):
        changed(tmp_path, lambda content: content["routes"]["W-E"].update(inside=drawn))


def test_encounters_are_the_conflicts_of_the_compiled_map(tmp_path: Path) -> None:
    source = MapSource.read(MAPS / "bendplatz.json")
    found = compiled(source)
    ids = [route.id for route in found.routes]
    compiled_pairs = {(ids[one.yielder], ids[one.prioritized]) for one in found.conflicts}
    pairs = encounters(source)
    assert len(pairs) == len(compiled_pairs)
    for one in pairs:
        assert one.first_yields is not None
        order = (one.first.id, one.second.id) if one.first_yields else (one.second.id, one.first.id)
        assert order in compiled_pairs
        assert max(one.early) <= 0.5


def test_pairs_of_which_nobody_yields_are_left_open_in_encounters(tmp_path: Path) -> None:
    source = changed(tmp_path, lambda content: content["arms"]["S"].update(right_of_way="priority"))
    open_ = [one for one in encounters(source) if one.first_yields is None]
    for one in open_:
        assert {one.first.entry, one.second.entry} == {"W", "E"}


@pytest.mark.parametrize("key", ["about", "locations", "stop_lines", "yields", "free"])
def test_what_a_source_need_not_name_may_be_left_out(tmp_path: Path, key: str) -> None:
    compiled(changed(tmp_path, lambda content: content.pop(key, None)))


@pytest.mark.parametrize("key", ["arms", "lanes", "routes"])
def test_a_source_without_what_makes_a_map_is_refused_by_the_key_that_is_missing(tmp_path: Path, key: str) -> None:
    with pytest.raises(ValueError, match=f'"{key}" is missing; wanted an object'):
        changed(tmp_path, lambda content: content.pop(key))
