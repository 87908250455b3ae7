"""Ranks of routes: whom a vehicle that waits itself still holds up."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from intersection_env.maps.intersection import MAPS, Intersection, shipped_maps
from tests.support.twins import twin_map


def holds(intersection: Intersection) -> dict[tuple[str, str], bool]:
    """Of pairs (yielder, prioritized), by route ids: whether the second holds the first up while it waits itself."""
    routes = intersection.routes
    pairs = [(routes[one.yielder], routes[one.prioritized]) for one in intersection.conflicts]
    return {(yielder.id, prioritized.id): prioritized.rank <= yielder.rank for yielder, prioritized in pairs}


@pytest.mark.parametrize("name", shipped_maps())
def test_each_route_has_the_rank_that_the_twin_gives_it(name: str) -> None:
    ranks = [route.rank for route in Intersection.load(name).routes]
    assert sorted(ranks) == list(range(len(ranks)))
    assert ranks == twin_map(name).ranks


@pytest.mark.parametrize(
    ("name", "major"), [("bendplatz", {"NW", "SE"}), ("crossroads", {"E", "W"}), ("t_junction", {"E", "W"})]
)
def test_who_waits_holds_others_up_on_a_road_with_priority_alone(name: str, major: set[str]) -> None:
    found = holds(Intersection.load(name))
    assert found == {pair: pair[1].partition("-")[0] in major for pair in found}


@pytest.mark.parametrize("name", ["all_way_stop", "roundabout"])
def test_in_a_circle_somebody_is_held_up_by_nobody_who_waits(name: str) -> None:
    found = holds(Intersection.load(name))
    assert set(found.values()) == {False, True}


@pytest.mark.parametrize("name", ["bendplatz", "crossroads", "t_junction"])
def test_the_order_in_which_routes_stand_in_the_source_does_not_matter(name: str, tmp_path: Path) -> None:
    source = json.loads((MAPS / f"{name}.json").read_text())
    source["routes"] = dict(reversed(source["routes"].items()))
    path = tmp_path / "turned.json"
    path.write_text(json.dumps(source))
    assert holds(Intersection.load(path)) == holds(Intersection.load(name))
