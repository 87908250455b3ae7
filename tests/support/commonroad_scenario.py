"""A small CommonRoad scenario of our own, in XML: lanes that meet, signs, and road users of all shapes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from data.formats.commonroad import read_commonroad
from data.maps.commonroad_file import read_commonroad as read_map

STEPS = 6
STEP = 0.2
"""[s]."""
HEAD = (
    f'<commonRoad commonRoadVersion="2020a" benchmarkID="ZAM_Made-1_1_T-1" timeStepSize="{STEP}" date="2026-01-01"'
    ' author="nobody" affiliation="none" source="made up">'
    "<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>"
    "<scenarioTags><urban/></scenarioTags>"
)
CAR = "<rectangle><length>4.5</length><width>1.8</width></rectangle>"
WEDGE = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((-5.0, -1.25), (5.5, 0.0), (-5.0, 1.25)))


def write_made_scenario(path: Path) -> None:
    """Writes it. A main road with a bus lane goes east; a side road with a stop line joins it from the south."""
    stop_line = f"<stopLine>{_points([(58.25, -8.0), (61.75, -8.0)])}<lineMarking>solid</lineMarking></stopLine>"
    lanelets = (
        _lanelet(1, [(0.0, 0.0), (30.0, 0.125), (60.0, 0.0)], (2,), signs=(31, 33)),
        _lanelet(2, [(60.0, 0.0), (90.0, 0.0), (120.0, 0.0)], (9,), kinds=("urban", "intersection")),
        _lanelet(3, [(60.0, -50.0), (60.0, -8.0)], (4,), signs=(32, 34), more=stop_line),
        _lanelet(4, [(60.0, -8.0), (61.5, -2.0), (68.0, 0.0)], (2,), users=("car", "bus")),
        _lanelet(5, [(0.0, -3.5), (60.0, -3.5)], (), kinds=("busLane",), users=("bus",)),
        _lanelet(6, [(40.0, 6.0), (40.0, -9.0)], (), kinds=("crosswalk",), both_ways=("pedestrian", "bicycle")),
        _lanelet(7, [(0.0, 9.0), (60.0, 9.0)], (), kinds=("country",), users=("bicycle",)),
        _lanelet(9, [(120.0, 0.0), (150.0, 2.0)], ()),
    )
    signs = (_sign(31, "306"), _sign(32, "205"), _sign(33, "274", "13.89"), _sign(34, "101"))
    way = np.arange(STEPS) * STEP
    obstacles = (
        _obstacle(101, "car", CAR, [_state(k, 8.0 * way[k], 0.25, 0.0, 8.0, 0.5) for k in range(STEPS)]),
        _obstacle(102, "truck", "<rectangle><length>9</length><width>2.5</width></rectangle>",
                  [_state(k + 1, 60.0, -40.0 + 5.0 * way[k], 1.5, (4.5, 5.5), (-0.5, 0.25)) for k in range(STEPS - 1)]),
        _obstacle(103, "bus", f"<polygon>{WEDGE}</polygon>",
                  [_state(k, 20.0 + 6.0 * way[k], -3.5, (-0.125, 0.125), 6.0) for k in range(STEPS)]),
        _obstacle(104, "bicycle", "<circle><radius>0.75</radius></circle>",
                  [_state(k, 5.0 + 4.0 * way[k], 9.0, 0.0, 4.0) for k in range(STEPS)]),
        _obstacle(105, "pedestrian", "<circle><radius>0.25</radius></circle>",
                  [_state(k, 40.0, 5.0 - 1.25 * way[k], -1.5, 1.25) for k in range(STEPS)]),
        _obstacle(106, "parkedVehicle", CAR, [_state(0, 95.0, 5.0, 3.0, 0.0)]),
        _obstacle(107, "constructionZone", CAR, [_state(0, 110.0, 5.0, 0.0, 0.0)]),
    )  # fmt: skip
    path.write_text(f"{HEAD}{''.join((*lanelets, *signs, _light(), *obstacles))}</commonRoad>\n", encoding="utf-8")


def _points(places: Iterable[Sequence[float]]) -> str:
    return "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in places)


def _lanelet(
    id: int,
    centre: Sequence[tuple[float, float]],
    successors: Sequence[int],
    signs: Sequence[int] = (),
    kinds: Sequence[str] = ("urban",),
    users: Sequence[str] = ("vehicle",),
    both_ways: Sequence[str] = (),
    more: str = "",
) -> str:
    """A lanelet 3.5 m wide; the order of its parts is the format's."""
    along = np.array(centre)
    east, north = (along[-1] - along[0]) / np.linalg.norm(along[-1] - along[0])
    left = np.round(1.75 * np.array([-north, east]), 3)
    users = () if both_ways else users
    return (
        f'<lanelet id="{id}"><leftBound>{_points((along + left).tolist())}</leftBound>'
        f"<rightBound>{_points((along - left).tolist())}</rightBound>"
        + "".join(f'<successor ref="{one}"/>' for one in successors)
        + more
        + "".join(f"<laneletType>{one}</laneletType>" for one in kinds)
        + "".join(f"<userOneWay>{one}</userOneWay>" for one in users)
        + "".join(f"<userBidirectional>{one}</userBidirectional>" for one in both_ways)
        + "".join(f'<trafficSignRef ref="{one}"/>' for one in signs)
        + "</lanelet>"
    )


def _sign(id: int, kind: str, value: str = "") -> str:
    more = f"<additionalValue>{value}</additionalValue>" if value else ""
    element = f"<trafficSignElement><trafficSignID>{kind}</trafficSignID>{more}</trafficSignElement>"
    place = f"<position>{_points([(58.0, -9.0)])}</position>"
    return f'<trafficSign id="{id}">{element}{place}<virtual>false</virtual></trafficSign>'


def _light() -> str:
    green = "<cycleElement><duration>10</duration><color>green</color></cycleElement>"
    place = f"<position>{_points([(120.0, 3.0)])}</position>"
    cycle = f"<cycle>{green}<timeOffset>0</timeOffset></cycle>"
    return f'<trafficLight id="41">{cycle}{place}<direction>all</direction><active>true</active></trafficLight>'


def _obstacle(id: int, kind: str, shape: str, states: Sequence[str]) -> str:
    """Static if it has one state."""
    tag = "dynamicObstacle" if len(states) > 1 else "staticObstacle"
    driven = "".join(f"<state>{one}</state>" for one in states[1:])
    return (
        f'<{tag} id="{id}"><type>{kind}</type><shape>{shape}</shape><initialState>{states[0]}</initialState>'
        + (f"<trajectory>{driven}</trajectory>" if driven else "")
        + f"</{tag}>"
    )


Value = float | tuple[float, float]
"""An exact value, or the ends of an interval."""


def _state(step: int, x: float, y: float, heading: Value, speed: Value, acceleration: Value | None = None) -> str:
    """A state; in the obstacle's first one commonroad-io sets what is missing to 0."""
    more = {} if acceleration is None else {"acceleration": acceleration}
    values = {"orientation": heading, "velocity": speed} | more
    return (
        f"<position>{_points([(round(x, 4), round(y, 4))])}</position>"
        + "".join(f"<{name}>{_value(value)}</{name}>" for name, value in values.items())
        + f"<time><exact>{step}</exact></time>"
    )


def _value(value: Value) -> str:
    if isinstance(value, tuple):
        return f"<intervalStart>{value[0]}</intervalStart><intervalEnd>{value[1]}</intervalEnd>"
    return f"<exact>{value}</exact>"


def assert_same_recording(one: Path, other: Path) -> None:
    """Whether two scenarios give the same recording."""
    first, second = (read_commonroad([path]) for path in (one, other))
    assert first.frame_rate == second.frame_rate
    assert first.track_id.tolist() == second.track_id.tolist()
    assert first.road_user == second.road_user
    assert first.left_out == second.left_out
    for name in ("length", "width", "offsets", "frame", "x", "y", "velocity", "acceleration", "heading"):
        np.testing.assert_allclose(getattr(first, name), getattr(second, name), atol=1e-9, err_msg=name)


def assert_same_map(one: Path, other: Path) -> None:
    """Whether two files give the same lanelets, in any order of what follows, and as many things unread."""
    first, second = (read_map(path) for path in (one, other))
    assert list(first.lanelets) == list(second.lanelets)
    for lanelet, its in zip(first.lanelets.values(), second.lanelets.values(), strict=True):
        assert sorted(lanelet.successors) == sorted(its.successors)
        assert lanelet.speed_limit == its.speed_limit
        assert lanelet.signs == its.signs
        assert (lanelet.stop_line is None) == (its.stop_line is None)
        for name in ("left", "right") if lanelet.stop_line is None else ("left", "right", "stop_line"):
            np.testing.assert_allclose(getattr(lanelet, name), getattr(its, name), atol=1e-9, err_msg=name)
    assert first.left_out == second.left_out
    assert first.ignored.total() == second.ignored.total()
