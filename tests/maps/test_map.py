"""Map sources, compiled maps, and what is refused of them."""

from __future__ import annotations

import contextlib
import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from intersection_env import Intersection, Predictor, Traffic, Vehicle, rank_maneuvers
from intersection_env.maps import compiler
from intersection_env.maps.__main__ import main
from intersection_env.maps.compiler import Recompiler, compile_map
from intersection_env.maps.conflicts import Meeting, meeting
from intersection_env.maps.intersection import MAPS, XY, Sample
from intersection_env.maps.source import MapSource
from tests.conftest import MAP_NAMES
from tests.support.damage import damages, thinned, with_checksum
from tests.support.twins import CASES


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


def test_compiling_again_gives_the_same_and_looks_only_at_what_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    source = MapSource.read(MAPS / "t_junction.json")
    lane = source.lanes["S_in"]
    moved = replace(source, lanes={**source.lanes, "S_in": replace(lane, points=lane.points + 0.05)})
    torn = replace(source, lanes={**source.lanes, "S_in": replace(lane, points=lane.points + 500.0)})
    other = replace(source, arms={**source.arms, "S": replace(source.arms["S"], right_of_way="stop")})
    recompiler, looked = Recompiler(), list[tuple[int, int]]()
    assert recompiler.compile(source) == compile_map(source)
    with contextlib.suppress(ValueError):
        recompiler.compile(torn)
    for one in (moved, other, source):
        assert recompiler.compile(one) == compile_map(one)

    def looking(*about: Any) -> Meeting:
        looked.append(about[1])
        return meeting(*about)

    monkeypatch.setattr(compiler, "meeting", looking)
    recompiler.compile(moved)
    touched = {k for k, route in enumerate(source.routes) if "S_in" in route.approach}
    assert set(looked) == {(a, b) for a in range(6) for b in range(a + 1, 6) if {a, b} & touched}


def test_samples_follow_the_centreline(intersection: Intersection) -> None:
    for route in intersection.routes:
        assert np.linalg.norm(np.diff(route.samples[:, XY], axis=0), axis=1) == pytest.approx(1.0, abs=0.02)
        step = np.diff(route.samples[:, XY], axis=0)
        east, north = step.T
        direction = np.arctan2(north, east)
        middle = 0.5 * (route.samples[1:, Sample.HEADING] + route.samples[:-1, Sample.HEADING])
        assert np.abs(np.angle(np.exp(1j * (direction - middle)))).max() < 0.05


def test_relative_headings_are_headings_elsewhere_on_the_route(intersection: Intersection) -> None:
    for route in intersection.routes:
        for column, offset in enumerate((-10, -3, 3, 10, 30, 100)):
            at = np.clip(np.arange(len(route.samples)) + offset, 0, len(route.samples) - 1)
            expected = route.samples[at, Sample.HEADING] - route.samples[:, Sample.HEADING]
            inner = slice(10, max(11, len(route.samples) - 101))
            assert np.abs(route.samples[inner, Sample.HEADINGS + column] - expected[inner]).max() < 0.02


def test_conflicts_begin_behind_the_stop_line_and_lie_on_both_routes(intersection: Intersection) -> None:
    """The bands of both routes overlap in every interval, and nowhere else inside the junction."""
    for conflict in intersection.conflicts:
        a, b = intersection.routes[conflict.yielder], intersection.routes[conflict.prioritized]
        for route, interval in ((a, conflict.on_yielder), (b, conflict.on_prioritized)):
            assert route.stop_line - 0.5 <= interval[0] < interval[1] <= route.length
        middle = intersection.sample(a.index, np.array([sum(conflict.on_yielder) / 2], np.float32))[0, XY]
        assert shapely.Point(middle).distance(shapely.LineString(b.samples[:, XY])) < 2.0


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
    # Lanes that were moved to where cars drive end up to 2.5 m from the measured ends, so that turns clear each other.
    assert all(15.0 <= inside[name] <= 24.5 for name in ("NW-NE", "SE-SW", "NE-SE", "SW-NW")), "left 16.9-24.5 m"
    assert all(9.0 <= inside[name] <= 15.0 for name in ("NW-SW", "SE-NE", "NE-NW", "SW-SE")), "right 9.0-14.5 m"
    main, side = by_id["NW-SE"].samples[:, Sample.V_MAX], by_id["NE-SW"].samples[:, Sample.V_MAX]
    assert main == pytest.approx(50 / 3.6)
    assert side == pytest.approx(30 / 3.6)


def test_two_routes_of_one_exit_agree_on_the_shared_lane(intersection: Intersection) -> None:
    merging = [lane for lane in intersection.shared_lanes if lane.begin_a > -1e5 and lane.end > 1e5]
    assert merging
    for lane in merging:
        s = np.arange(lane.begin_a + 8.0, intersection.routes[lane.a].length - 1.0, 3.0, dtype=np.float32)
        one = intersection.sample(lane.a, s)[:, XY]
        other = intersection.sample(lane.b, s + np.float32(lane.offset))[:, XY]
        assert np.abs(one - other).max() < 0.05


def test_width_runs_evenly_from_point_to_point(tmp_path: Path) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text())
    (x, y), end = source["lanes"]["W_in"]["points"]
    source["lanes"]["W_in"] = {"width": [3.0, 5.0, 4.0], "points": [[x, y], [x + 100.0, y], end]}
    (tmp_path / "wide.json").write_text(json.dumps(source))
    route = Intersection.load(tmp_path / "wide.json").routes[0]
    assert route.id == "W-E"
    begin, leave = route.junction
    position = np.arange(len(route.samples), dtype=np.float64)
    expected = np.interp(position, [0.0, 100.0, begin, leave], [3.0, 5.0, 4.0, 3.25])
    assert np.abs(route.samples[:, Sample.WIDTH] - expected).max() < 1e-4


def test_unknown_name_lists_what_ships() -> None:
    with pytest.raises(
        ValueError,
        match=r'no map "nowhere" ships \(there are all_way_stop, bendplatz, crossroads, roundabout, t_junction\)',
    ):
        Intersection.load("nowhere")
    with pytest.raises(FileNotFoundError, match=r"missing\.map"):
        Intersection.load("missing.map")
    with pytest.raises(ValueError, match='has no route "A-B"; its routes are W-E'):
        Intersection.load("t_junction").route_index("A-B")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: "", "is not a file of the kind"),
        (lambda text: text.replace("map 2", "map 1", 1), 'is of version "1", this package reads version 2'),
        (lambda text: text[: len(text) // 2], "is cut short"),
        (lambda text: text.replace("spacing 1", "spacing 2", 1), "does not match its checksum"),
        (lambda text: with_checksum(body_of("t_junction").replace("spacing 1", "spacing x", 1)), ":4: a finite number"),
        (lambda text: with_checksum(body_of("t_junction").replace("spacing 1", "spacing nan", 1)), "finite number"),
        (lambda text: with_checksum(body_of("t_junction").replace("spacing 1", "spacing -1", 1)), "must be positive"),
        (lambda text: with_checksum(body_of("t_junction").replace("routes 6", "routes 7", 1)), '"route" was expected'),
        (lambda text: with_checksum(body_of("t_junction").replace("routes 6", "routes 9999", 1)), "from 1 to 256"),
        (lambda text: with_checksum(body_of("t_junction") + "more\n"), "nothing was expected here"),
        (lambda text: with_checksum(body_of("t_junction").replace("name t_", "name ../t_", 1)), "as it names files"),
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


def test_damage_anywhere_with_a_right_checksum_never_crashes() -> None:
    """Bytes changed, lines lost, doubled or cut, the end cut off: refused in words, or a map that can be driven on."""
    generator = np.random.default_rng(1)
    body = thinned((MAPS / "t_junction.map").read_text()).rpartition("checksum ")[0]
    refused = 0
    for damaged in damages(body, 1500 * CASES, generator):
        try:
            fuzzed = Intersection(with_checksum(damaged), "fuzzed.map")
        except ValueError as error:
            assert str(error).startswith("fuzzed.map")  # noqa: PT017, what is let in counts too
            refused += 1
            continue
        vehicles = [Vehicle(route.id, route.id, 0.5 * route.length, 5.0) for route in fuzzed.routes]
        with contextlib.suppress(ValueError):  # who overlaps by the damage
            rank_maneuvers(Predictor.load("gap"), Traffic.of(fuzzed, vehicles), limit=20)
    assert 500 * CASES < refused < 1450 * CASES


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "something"}, '"format" must be'),
        ({"version": 9}, '"version" is 9, this package reads 2'),
        ({"name": "two words"}, '"name" must be one word'),
        ({"name": "a/b"}, "as it names files, not 'a/b'"),
        ({"name": "../a"}, "as it names files, not '../a'"),
        ({"name": ".hidden"}, "as it names files, not '.hidden'"),
        ({"name": ""}, "as it names files, not ''"),
        ({"arms": {"W": {"right_of_way": "maybe", "speed_limit_kmh": 50}}}, '"right_of_way" must be one of'),
        ({"arms": {"W": {"right_of_way": "yield", "speed_limit_kmh": -5}}}, "must be a positive number, not -5"),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, 0]]}}}, "at least 2 points"),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, 0], [0, 0]]}}}, "each apart from the one before"),
        (
            {"lanes": {"W_in": {"width": [3, 3, 3], "points": [[0, 0], [9, 0]]}}},
            r'lane "W_in": "width" lists 3 numbers; wanted one, or one for each of 2 points',
        ),
        ({"lanes": {"W_in": {"width": [], "points": [[0, 0], [9, 0]]}}}, '"width" lists 0 numbers'),
        ({"lanes": {"W_in": {"width": [3, -1], "points": [[0, 0], [9, 0]]}}}, "must be a positive number, not -1"),
        ({"lanes": {"W_in": {"width": [3, [3]], "points": [[0, 0], [9, 0]]}}}, r"must be a positive number, not \[3\]"),
        ({"routes": {}}, '"routes" is empty'),
        ({"routes": {"W-X": {"approach": ["W_in"], "exit": ["E_out"]}}}, "must be named by two arms"),
        ({"routes": {"W-E": {"approach": ["gone"], "exit": ["E_out"]}}}, "must be a list of lanes"),
        ({"routes": {"W-E": {"approach": [["x"]], "exit": ["E_out"]}}}, "must be a list of lanes"),
        ({"routes": {"W-E": ["W_in", "E_out"]}}, 'route "W-E" must be an object, not list'),
        ({"yields": [["W-E", "nowhere"]]}, 'no route "nowhere" in .*; routes: .*W-E'),
        ({"yields": 5}, "must be a list of pairs"),
        ({"yields": [[["a"], "b"]]}, "pairs of route ids"),
        ({"yields": [["W-E", "W-E"]]}, 'route "W-E" yields to itself'),
        ({"yields": [["W-E", "S-W"], ["S-W", "W-E"]]}, '"S-W" and "W-E" each yield to the other'),
        ({"free": [["W-E", "nowhere"]]}, '"free": there is no route "nowhere"'),
        ({"free": [["W-E", "W-E"]]}, '"free" says that route "W-E" is free of itself'),
        ({"yields": [["W-E", "S-W"]], "free": [["S-W", "W-E"]]}, '"W-E" and "S-W" are under "yields" and under "free"'),
        (
            {"routes": {"W-E": {"approach": ["W_in"], "inside": ["gone"], "exit": ["E_out"]}}},
            "\"inside\" must be a list of lanes, there is no lane 'gone'",
        ),
        ({"routes": {"W-E": {"approach": ["W_in", "W_in"], "exit": ["E_out"]}}}, '"W-E" uses a lane twice'),
        ({"locations": [True]}, '"locations" must be a list of integers from 0 to 1000000'),
        ({"locations": [1.0]}, '"locations" must be a list of integers'),
        ({"locations": [-1]}, '"locations" must be a list of integers'),
        ({"locations": [1000001]}, '"locations" must be a list of integers'),
        ({"arms": {"W-": {"right_of_way": "yield", "speed_limit_kmh": 50}}}, 'arm "W-" must be named by one word'),
        ({"arms": {"the west": {"right_of_way": "yield", "speed_limit_kmh": 50}}}, 'arm "the west" must be named'),
        ({"arms": {"W": {"right_of_way": "yield", "speed_limit": 50}}}, 'arm "W" has an unknown key "speed_limit"'),
        ({"lanes": {"W_in": {"wide": 3}}}, 'lane "W_in" has an unknown key "wide"; wanted width, points'),
        ({"routes": {"W-E": {"approach": ["W_in"], "leaving": []}}}, 'route "W-E" has an unknown key "leaving"'),
        ({"stop_line": {}}, 'unknown key "stop_line"'),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, 0], [1e7, 0]]}}}, r"holds \[1e\+07, 0\]; wanted local metres"),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, -2001], [1, 0]]}}}, r"holds \[0, -2001\]; .* another origin"),
        ({"lanes": {"W_in": {"width": 3, "points": [["0", "0"], ["1", "1"]]}}}, r"must be a list of \[x, y\]"),
        ({"lanes": {"W_in": {"width": 3, "points": [[0, 0], [10**400, 1]]}}}, r"must be a list of \[x, y\]"),
        ({"stop_lines": {"gone": [[0, 0], [1, 1]]}}, "no lane of that name"),
        ({"stop_lines": {"S_in": [[90, 90], [91, 91]]}}, "must cross the stop line"),
        ({"stop_lines": {"S_in": [[-6, -3.0], [8, -3.0]]}}, "begins .* m before the stop line"),
    ],
)
def test_map_source_that_contradicts_itself_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text()) | change
    path = tmp_path / "source.json"
    path.write_text(json.dumps(source))
    with pytest.raises(ValueError, match=message) as refused:
        Intersection.load(path)
    assert str(refused.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "not JSON"),
        ('{"format": 1, "format": 2}', '"format" is there twice'),
        ("[]", '"format" must be'),
    ],
)
def test_file_that_is_no_map_source_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "source.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as refused:
        Intersection.load(path)
    assert str(refused.value).startswith(f"{path}: ")


def test_routes_that_share_only_a_later_lane_follow_each_other_there(tmp_path: Path) -> None:
    """An exit that merges later, and a route that begins in the middle of another one's approach."""
    path = tmp_path / "source.json"
    source = json.loads((MAPS / "t_junction.json").read_text())
    source["lanes"]["S_out_beside"] = {"width": 3.0, "points": [[2.9, -16.0], [-0.5, -24.0]]}
    source["routes"]["E-S"]["exit"] = ["S_out_beside", "S_out_outer"]
    source["routes"]["S-E"]["approach"] = ["S_in"]
    path.write_text(json.dumps(source | {"free": [["S-W", "E-S"], ["S-E", "E-S"]]}))
    found = Intersection.load(path)
    w_s, e_s, s_w, s_e = (found.routes[found.route_index(id)] for id in ("W-S", "E-S", "S-W", "S-E"))
    exit_, approach = (
        next(one for one in found.shared_lanes if (one.a, one.b) == (a.index, b.index))
        for a, b in ((w_s, e_s), (s_w, s_e))
    )
    assert e_s.junction[1] + 5.0 < exit_.begin_b < e_s.length
    assert exit_.end > 1e5
    conflict = next(one for one in found.conflicts if {one.yielder, one.prioritized} == {w_s.index, e_s.index})
    assert conflict.merging
    assert {conflict.on_yielder[1], conflict.on_prioritized[1]} == {exit_.begin_a, exit_.begin_b}
    assert approach.begin_b < -1e5
    assert approach.offset < -20.0
    behind = Vehicle("behind", "S-W", float(approach.begin_a - 8.0), 5.0)
    traffic = Traffic.of(found, [behind, Vehicle("ahead", "S-E", 6.0, 0.0)])
    gap = Predictor.load("gap").observe(traffic).driving[0, 9]
    assert gap == pytest.approx(6.0 - approach.offset - (approach.begin_a - 8.0) - 4.5, abs=0.01)


def test_all_undecided_pairs_are_named_at_once_with_what_to_add(tmp_path: Path) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text())
    source["arms"] = {arm: {"right_of_way": "priority", "speed_limit_kmh": 50} for arm in source["arms"]}
    source["routes"]["E-W.2"] = {"approach": ["E_in"], "inside": [[6.5, 1.65], [0, 6], [-11, 1.65]], "exit": ["W_out"]}
    source["stop_lines"]["S_in"] = [[-6.0, -3.0], [8.0, -3.0]]
    path = tmp_path / "source.json"
    path.write_text(json.dumps(source))
    with pytest.raises(ValueError, match="undecided") as refused:
        Intersection.load(path)
    said = str(refused.value)
    assert said.count("before the stop line") >= 2
    assert 'routes "E-W" and "E-W.2" conflict with equal right of way' in said
    assert '"yields": [["E-W.2", "E-W"]]' in said
    assert '"free"' in said


def test_pair_declared_free_has_no_conflict(tmp_path: Path) -> None:
    path = tmp_path / "source.json"
    source = json.loads((MAPS / "t_junction.json").read_text())
    path.write_text(json.dumps(source | {"free": [["S-W", "E-W"], ["W-E", "S-W"]]}))
    found = Intersection.load(path)
    pairs = {frozenset((found.routes[c.yielder].id, found.routes[c.prioritized].id)) for c in found.conflicts}
    assert len(pairs) == len(Intersection.load("t_junction").conflicts) - 2
    assert frozenset(("S-W", "E-W")) not in pairs
    assert any({found.routes[s.a].id, found.routes[s.b].id} == {"S-W", "E-W"} for s in found.shared_lanes)


def test_old_files_are_refused_with_what_makes_new_ones(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text(json.dumps(json.loads((MAPS / "t_junction.json").read_text()) | {"version": 1}))
    with pytest.raises(ValueError, match=r'"version" is 1, this package reads 2\. .*"version" to 2.*data\.maps'):
        Intersection.load(path)
    path = tmp_path / "old.map"
    path.write_text((MAPS / "t_junction.map").read_text().replace("map 2", "map 1", 1))
    with pytest.raises(ValueError, match=r'of version "1", .* version 2; .*python -m intersection_env\.map_compiler'):
        Intersection.load(path)


def test_command_names_a_bad_source_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "bad.json", tmp_path / "out" / "bad.map"
    source = json.loads((MAPS / "t_junction.json").read_text())
    path.write_text(json.dumps(source | {"stop_lines": {"S_in": [[90, 90], [91, 91]]}}))
    assert main([str(path), str(out)]) == 1
    path.write_text(json.dumps(source | {"locations": list(range(1001))}))  # compiles, but the core refuses it
    assert main([str(path), str(out)]) == 1
    assert main([str(tmp_path / "missing.json"), str(out)]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert [line.startswith("error: ") for line in lines] == [True] * 3
    assert all(str(path) in line for line in lines[:2])
    assert not out.parent.exists()
    path.write_text(json.dumps(source))
    assert main([str(path), str(out)]) == 0
    assert out.read_bytes() == (MAPS / "t_junction.map").read_bytes()


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


def test_routes_may_part_behind_their_common_exit_lane_and_use_no_lane_twice(tmp_path: Path) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text())
    source["routes"]["E-S"]["exit"] = ["S_out"]
    path = tmp_path / "source.json"
    path.write_text(json.dumps(source))
    parted = Intersection.load(path)
    short, long = (parted.routes[parted.route_index(name)] for name in ("E-S", "W-S"))
    assert short.length < long.length
    (shared,) = (one for one in parted.shared_lanes if {one.a, one.b} == {short.index, long.index})
    assert 0.0 < shared.begin_a < parted.routes[shared.a].junction[1]
    assert 0.0 < shared.begin_b < parted.routes[shared.b].junction[1]
    source["routes"]["E-S"]["exit"] = ["S_out", "S_out_outer", "S_out"]
    path.write_text(json.dumps(source))
    with pytest.raises(ValueError, match='"E-S" uses a lane twice'):
        Intersection.load(path)
