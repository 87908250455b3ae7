"""Ranks of routes: whom a vehicle that waits itself still holds up."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from intersection_env.maps.intersection import MAPS, Intersection, shipped_maps
from tests.support.twins import twin_of

MAJOR = {"bendplatz": {"NW", "SE"}, "crossroads": {"E", "W"}, "t_junction": {"E", "W"}}


def source_of(name: str) -> dict[str, Any]:
    source: dict[str, Any] = json.loads((MAPS / f"{name}.json").read_text())
    return source


def compiled(source: dict[str, Any], folder: Path) -> Intersection:
    path = folder / "source.json"
    path.write_text(json.dumps(source))
    return Intersection.load(path)


def holds(intersection: Intersection) -> dict[tuple[str, str], bool]:
    """Of pairs (yielder, prioritized), by route ids: whether the second holds the first up while it waits itself."""
    routes = intersection.routes
    pairs = [(routes[one.yielder], routes[one.prioritized]) for one in intersection.conflicts]
    return {(yielder.id, prioritized.id): prioritized.rank <= yielder.rank for yielder, prioritized in pairs}


def circles(intersection: Intersection) -> set[tuple[str, str]]:
    """The pairs (yielder, prioritized) of which the second yields to the first too, through others."""
    yields = set(holds(intersection))

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        while new := {there for here, there in yields if here in {start, *found}} - found:
            found |= new
        return found

    return {pair for pair in yields if pair[0] in reached(pair[1])}


def right_before_left() -> dict[str, Any]:
    source = source_of("all_way_stop")
    source["arms"] = {arm: {**entry, "right_of_way": "right_before_left"} for arm, entry in source["arms"].items()}
    return source


@pytest.mark.parametrize("name", shipped_maps())
def test_each_route_has_the_rank_that_the_twin_gives_it(name: str) -> None:
    intersection = Intersection.load(name)
    ranks = [route.rank for route in intersection.routes]
    assert sorted(ranks) == list(range(len(ranks)))
    assert ranks == twin_of(intersection).ranks


def test_ranks_of_right_before_left_are_the_twins(tmp_path: Path) -> None:
    intersection = compiled(right_before_left(), tmp_path)
    assert [route.rank for route in intersection.routes] == twin_of(intersection).ranks


@pytest.mark.parametrize("name", MAJOR)
def test_who_waits_holds_others_up_on_a_road_with_priority_alone(name: str) -> None:
    found = holds(Intersection.load(name))
    assert found == {pair: pair[1].partition("-")[0] in MAJOR[name] for pair in found}


def test_a_route_that_meets_nobody_gives_its_road_no_priority(tmp_path: Path) -> None:
    source = source_of("crossroads")
    apart = [[x, y - 12.0] for x, y in source["lanes"]["E_out"]["points"]]
    source["lanes"]["E_out2"] = {**source["lanes"]["E_out"], "points": apart}
    source["routes"]["S-E"] = {**source["routes"]["S-E"], "exit": ["E_out2"]}
    intersection = compiled(source, tmp_path)
    found = holds(intersection)
    assert not any("S-E" in pair for pair in found)
    assert found == {pair: pair[1].partition("-")[0] in MAJOR["crossroads"] for pair in found}
    assert [route.rank for route in intersection.routes] == twin_of(intersection).ranks


@pytest.mark.parametrize("name", ["all_way_stop", "roundabout", "right_before_left"])
def test_in_circles_alone_somebody_is_let_go_on_a_road_with_priority_or_held_up_on_another(
    name: str, tmp_path: Path
) -> None:
    intersection = compiled(right_before_left(), tmp_path) if name == "right_before_left" else Intersection.load(name)
    found = holds(intersection)
    usual = name != "roundabout"  # elsewhere every road has priority by its right turn
    unusual = {pair for pair, is_held in found.items() if is_held != usual}
    assert unusual
    assert unusual <= circles(intersection)


@pytest.mark.parametrize("name", MAJOR)
def test_the_order_in_which_routes_stand_in_the_source_matters_in_circles_alone(name: str, tmp_path: Path) -> None:
    source = source_of(name)
    source["routes"] = dict(reversed(source["routes"].items()))
    turned, plain = compiled(source, tmp_path), Intersection.load(name)
    assert not circles(plain)
    assert holds(turned) == holds(plain)
