"""Map sources, compiled maps, and what is refused of them."""

from __future__ import annotations

import contextlib
import json
import pickle
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from intersection_env import Intersection
from intersection_env.intersection import MAPS
from intersection_env.map_compiler import compile_map
from intersection_env.map_source import MapSource
from tests.conftest import MAP_NAMES


def with_checksum(body: str) -> str:
    return f"{body}checksum {zlib.crc32(body.encode()):08x}\n"


def body_of(name: str) -> str:
    text = (MAPS / f"{name}.map").read_text()
    return text[: text.rindex("checksum ")]


@pytest.mark.parametrize("name", MAP_NAMES)
def test_shipped_map_is_what_its_source_compiles_to(name: str) -> None:
    """Regenerate with `make maps`. Numbers may differ in the last digit between versions of GEOS."""
    fresh = compile_map(MapSource.read(MAPS / f"{name}.json")).split()[:-1]
    shipped = (MAPS / f"{name}.map").read_text().split()[:-1]
    assert len(fresh) == len(shipped)
    for one, other in zip(fresh, shipped, strict=True):
        assert one == other or float(one) == pytest.approx(float(other), abs=1e-5)


def test_samples_follow_the_centreline(intersection: Intersection) -> None:
    for route in intersection.routes:
        assert np.linalg.norm(np.diff(route.samples[:, :2], axis=0), axis=1) == pytest.approx(1.0, abs=0.02)
        step = np.diff(route.samples[:, :2], axis=0)
        direction = np.arctan2(step[:, 1], step[:, 0])
        middle = 0.5 * (route.samples[1:, 2] + route.samples[:-1, 2])
        assert np.abs(np.angle(np.exp(1j * (direction - middle)))).max() < 0.05


def test_relative_headings_are_headings_elsewhere_on_the_route(intersection: Intersection) -> None:
    for route in intersection.routes:
        for column, offset in enumerate((-10, -3, 3, 10, 30, 100)):
            at = np.clip(np.arange(len(route.samples)) + offset, 0, len(route.samples) - 1)
            expected = route.samples[at, 2] - route.samples[:, 2]
            inner = slice(10, max(11, len(route.samples) - 101))
            assert np.abs(route.samples[inner, 5 + column] - expected[inner]).max() < 0.02


def test_conflicts_begin_behind_the_stop_line_and_lie_on_both_routes(intersection: Intersection) -> None:
    """The bands of both routes overlap in every interval, and nowhere else inside the junction."""
    for conflict in intersection.conflicts:
        a, b = intersection.routes[conflict.yielder], intersection.routes[conflict.prioritized]
        for route, interval in ((a, conflict.on_yielder), (b, conflict.on_prioritized)):
            assert route.stop_line - 0.5 <= interval[0] < interval[1] <= route.length
        middle = intersection.sample(a.index, np.array([sum(conflict.on_yielder) / 2], np.float32))[0, :2]
        assert shapely.Point(middle).distance(shapely.LineString(b.samples[:, :2])) < 2.0


def test_bendplatz_has_the_right_of_way_of_its_signs() -> None:
    bendplatz = Intersection.load("bendplatz")
    index = bendplatz.route_index
    yields = {(c.yielder, c.prioritized) for c in bendplatz.conflicts}
    assert (index("NE-SW"), index("SE-NW")) in yields, "STOP at NE"
    assert (index("SW-NW"), index("NW-SE")) in yields, "YIELD at SW"
    assert (index("NW-NE"), index("SE-NW")) in yields, "a main-road left turn yields to oncoming traffic"
    assert (index("NE-SE"), index("SW-NE")) in yields, "a minor-road left turn yields to oncoming minor traffic"
    assert {bendplatz.routes[y].id.split("-")[0] for y, p in yields if bendplatz.routes[p].id == "NW-SE"} == {
        "NE",
        "SW",
        "SE",
    }


def test_bendplatz_agrees_with_the_measured_street() -> None:
    bendplatz = Intersection.load("bendplatz")
    by_id = {route.id: route for route in bendplatz.routes}
    inside = {name: route.junction[1] - route.junction[0] for name, route in by_id.items()}
    assert all(17.0 <= inside[name] <= 22.6 for name in ("NW-SE", "SE-NW", "NE-SW", "SW-NE")), "straight 19.6-22.6 m"
    assert all(16.9 <= inside[name] <= 24.5 for name in ("NW-NE", "SE-SW", "NE-SE", "SW-NW"))
    assert all(9.0 <= inside[name] <= 14.5 for name in ("NW-SW", "SE-NE", "NE-NW", "SW-SE"))
    main, side = by_id["NW-SE"].samples[:, 4], by_id["NE-SW"].samples[:, 4]
    assert main == pytest.approx(50 / 3.6)
    assert side == pytest.approx(30 / 3.6)


def test_two_routes_of_one_exit_agree_on_the_shared_lane(intersection: Intersection) -> None:
    merging = [lane for lane in intersection.shared_lanes if lane.merge_a < 1e5]
    assert merging
    for lane in merging:
        s = np.arange(lane.merge_a + 8.0, intersection.routes[lane.a].length - 1.0, 3.0, dtype=np.float32)
        one = intersection.sample(lane.a, s)[:, :2]
        other = intersection.sample(lane.b, s + np.float32(lane.offset))[:, :2]
        assert np.abs(one - other).max() < 0.05


def test_unknown_name_lists_what_ships() -> None:
    with pytest.raises(ValueError, match=r'no map "nowhere" ships \(there are bendplatz, t_junction\)'):
        Intersection.load("nowhere")
    with pytest.raises(FileNotFoundError, match=r"missing\.map"):
        Intersection.load("missing.map")
    with pytest.raises(ValueError, match='has no route "A-B"; its routes are W-E'):
        Intersection.load("t_junction").route_index("A-B")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: "", "is not a file of the kind"),
        (lambda text: text.replace("map 1", "map 2", 1), 'is of version "2", this package reads version 1'),
        (lambda text: text[: len(text) // 2], "is cut short"),
        (lambda text: text.replace("spacing 1", "spacing 2", 1), "does not match its checksum"),
        (lambda text: with_checksum(body_of("t_junction").replace("spacing 1", "spacing x", 1)), ":4: a finite number"),
        (lambda text: with_checksum(body_of("t_junction").replace("spacing 1", "spacing nan", 1)), "finite number"),
        (lambda text: with_checksum(body_of("t_junction").replace("spacing 1", "spacing -1", 1)), "must be positive"),
        (lambda text: with_checksum(body_of("t_junction").replace("routes 6", "routes 7", 1)), '"route" was expected'),
        (lambda text: with_checksum(body_of("t_junction").replace("routes 6", "routes 9999", 1)), "from 1 to 256"),
        (lambda text: with_checksum(body_of("t_junction") + "more\n"), "nothing was expected here"),
        (lambda text: with_checksum(body_of("t_junction").replace("length 320", "length 900", 1)), "do not cover"),
    ],
)
def test_damaged_compiled_map_is_refused_by_name_of_what_is_wrong(tmp_path: Path, damage: Any, message: str) -> None:
    path = tmp_path / "damaged.map"
    path.write_text(damage((MAPS / "t_junction.map").read_text()))
    with pytest.raises(ValueError, match=message) as refused:
        Intersection.load(path)
    assert str(path) in str(refused.value)


def test_every_cut_of_a_map_is_refused() -> None:
    text = (MAPS / "t_junction.map").read_text()
    for end in np.random.default_rng(0).integers(0, len(text) - 1, 60):
        with pytest.raises(ValueError, match=r"cut short|not a file|checksum|version"):
            Intersection(text[:end], "cut.map")


def test_random_damage_with_a_right_checksum_never_crashes() -> None:
    generator = np.random.default_rng(1)
    body = body_of("t_junction")
    for _ in range(300):
        at = int(generator.integers(len(body)))
        damaged = body[:at] + chr(int(generator.integers(32, 127))) + body[at + 1 :]
        with contextlib.suppress(ValueError):
            assert Intersection(with_checksum(damaged), "fuzzed.map").routes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "something"}, '"format" must be'),
        ({"version": 9}, '"version" is 9, this package reads 1'),
        ({"name": "two words"}, '"name" must be one word'),
        ({"arms": {"W": {"right_of_way": "maybe", "speed_limit_kmh": 50}}}, '"right_of_way" must be one of'),
        ({"arms": {"W": {"right_of_way": "yield", "speed_limit_kmh": -5}}}, "must be a positive number, not -5"),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, 0]]}}}, "at least 2 points"),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, 0], [0, 0]]}}}, "each apart from the one before"),
        ({"routes": {}}, '"routes" is empty'),
        ({"routes": {"W-X": {"approach": ["W_in"], "exit": ["E_out"]}}}, "must be named by two arms"),
        ({"routes": {"W-E": {"approach": ["gone"], "exit": ["E_out"]}}}, "must be a list of lanes"),
        ({"yields": [["W-E", "nowhere"]]}, "pairs of route ids"),
        ({"stop_lines": {"gone": [[0, 0], [1, 1]]}}, "no lane of that name"),
        ({"stop_lines": {"S_in": [[90, 90], [91, 91]]}}, "must cross the stop line"),
        ({"stop_lines": {"S_in": [[-6, -3.0], [8, -3.0]]}}, "begins .* m before the stop line"),
    ],
)
def test_map_source_that_contradicts_itself_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text()) | change
    path = tmp_path / "source.json"
    path.write_text(json.dumps(source))
    with pytest.raises(ValueError, match=message):
        Intersection.load(path)


def test_equal_rank_without_a_rule_must_be_settled_by_the_author(tmp_path: Path) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text())
    source["lanes"]["W_in"]["points"] = [[-160.0, 1.0], [-11.0, 1.0]]
    source["lanes"]["E_out"]["points"] = [[11.0, 1.0], [160.0, 1.0]]
    path = tmp_path / "source.json"
    path.write_text(json.dumps(source))
    with pytest.raises(ValueError, match=r'say who waits under "yields"|before the stop line'):
        Intersection.load(path)


def test_intersection_survives_pickling() -> None:
    one = Intersection.load("t_junction")
    other = pickle.loads(pickle.dumps(one))
    assert other == one
    assert other.routes[0].id == "W-E"
    assert hash(other) == hash(one)
