"""Lanelets that go round make a roundabout: ways are cut where they enter the ring, and shared lanes are shared."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from data.maps.junction import Circle
from data.maps.lanelets import Lanelet, LaneMap
from data.maps.paths import Way
from data.maps.ring import around, ring_of
from data.maps.source_of import source_of
from data.source_text import source_text
from intersection_env import Intersection, Predictor, Traffic, Vehicle
from intersection_env.maps.compiler import compile_map

RADIUS, BESIDE, TURN = 15.0, 2.25, np.radians(33.0)
ARMS = ("E", "N", "W", "S")


def lanelet(id: str, points: list[tuple[float, float]], angle: float, *after: str) -> Lanelet:
    """A lanelet 3.5 m wide around a line that is turned by an angle [rad]."""
    turned = np.array(points) @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    way = np.gradient(turned, axis=0)
    left = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.linalg.norm(way, axis=1)[:, None] * 1.75
    return Lanelet(id, turned + left, turned - left, after, 30 / 3.6)


def arc(begin: float, end: float) -> list[tuple[float, float]]:
    return [(RADIUS * np.cos(t), RADIUS * np.sin(t)) for t in np.linspace(begin, end, 12)]


def ring_map() -> LaneMap:
    """Four arms around a ring of lanelets."""
    lanelets = {}
    for number, arm in enumerate(ARMS):
        angle, following = number * np.pi / 2, ARMS[(number + 1) % 4]
        joins = arc(TURN, TURN + 0.01)[0]
        leaves = arc(-TURN, 0.0)[0]
        parts = [
            lanelet(f"{arm}_in", [(110.0, BESIDE), (60.0, BESIDE), (26.0, BESIDE)], angle, f"{arm}_entry"),
            lanelet(f"{arm}_entry", [(26.0, BESIDE), (19.0, 3.2), joins], angle, f"{arm}_{following}"),
            lanelet(f"{arm}_{following}", arc(TURN, np.pi / 2 - TURN), angle, f"past_{following}", f"{following}_exit"),
            lanelet(f"past_{arm}", arc(-TURN, TURN), angle, f"{arm}_{following}"),
            lanelet(f"{arm}_exit", [leaves, (19.0, -3.2), (26.0, -BESIDE)], angle, f"{arm}_out"),
            lanelet(f"{arm}_out", [(26.0, -BESIDE), (60.0, -BESIDE), (110.0, -BESIDE)], angle),
        ]
        lanelets.update({one.id: one for one in parts})
    return LaneMap(lanelets)


def test_ring_is_what_leads_back_to_itself() -> None:
    found = ring_of(ring_map(), [id for id in ring_map().lanelets if not id.endswith(("_in", "_out"))])
    assert found == {
        *(f"{a}_{b}" for a, b in zip(ARMS, ARMS[1:] + ARMS[:1], strict=True)),
        *(f"past_{a}" for a in ARMS),
    }


def test_way_is_cut_where_it_enters_and_leaves_the_ring() -> None:
    way = Way(("E_in",), ("E_entry", "E_N", "past_N", "N_W", "W_exit"), ("W_out",))
    ring = frozenset(("E_N", "past_N", "N_W"))
    assert around(way, ring) == Way(("E_in", "E_entry"), ("E_N", "past_N", "N_W"), ("W_exit", "W_out"))
    assert around(Way(("E_in",), ("E_entry",), ("N_out",)), ring) is None


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Intersection:
    found = source_of(ring_map(), "ring", Circle(0.0, 0.0, 24.0))
    path = tmp_path_factory.mktemp("ring") / "ring.json"
    path.write_text(source_text(found.content("made by a test")))
    assert {arm["right_of_way"] for arm in json.loads(path.read_text())["arms"].values()} == {"roundabout"}
    return Intersection.load(path)


def test_who_circulates_goes_first_on_an_imported_roundabout(imported: Intersection) -> None:
    pairs = {(imported.routes[c.yielder].id, imported.routes[c.prioritized].id) for c in imported.conflicts}
    assert {("E-S", "W-N"), ("W-N", "E-S"), ("E-W", "S-N"), ("N-S", "E-W")} <= pairs
    assert ("S-N", "E-W") not in pairs
    assert all(c.merging and c.line > imported.routes[c.prioritized].stop_line for c in imported.conflicts)


def test_every_arm_of_an_imported_roundabout_leads_back_to_itself_too(imported: Intersection) -> None:
    assert {route.id for route in imported.routes} == {f"{a}-{b}" for a in ARMS for b in ARMS}
    back = imported.routes[imported.route_index("N-N")]
    turned = back.samples[round(back.length) - 10, 2] - back.samples[10, 2]
    assert turned == pytest.approx(np.pi, abs=0.05)  # once around the middle, counter-clockwise
    predictor, traffic = Predictor.load("idm"), Traffic.of(imported, [Vehicle("car", "N-N", 20.0, 6.0)])
    for _ in range(6):
        traffic = predictor.predict(traffic).traffic_at(10.0)
    assert not len(traffic)


def test_the_file_holds_the_source_that_was_decided_on_to_the_last_digit(imported: Intersection) -> None:
    assert compile_map(source_of(ring_map(), "ring", Circle(0.0, 0.0, 24.0)).source) == imported.text


def test_imported_file_has_one_lane_for_each_stretch_of_the_ring(imported: Intersection, tmp_path: Path) -> None:
    found = source_of(ring_map(), "ring", Circle(0.0, 0.0, 24.0)).source
    assert len([name for name in found.lanes if name.startswith("ring_lane")]) == 8
    assert all(route.interior and route.inside is None for route in found.routes)
