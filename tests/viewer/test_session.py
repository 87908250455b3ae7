"""What the viewer shows is what the public functions say, and what cannot be is refused in a sentence."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Scenes, Traffic, Vehicle, forecast, rank_maneuvers
from intersection_env.constants import DT
from intersection_env.viewer.asked import asked
from intersection_env.viewer.session import Place, Session

DEFAULT = Predictor.load()
BENDPLATZ = Intersection.load("bendplatz")


@pytest.fixture(scope="module")
def session() -> Session:
    scenes = Scenes.load("bendplatz").select("development")
    return Session([Place(scenes.intersection, scenes), Place(Intersection.load("roundabout"))], DEFAULT)


@pytest.fixture(scope="module")
def moment(session: Session) -> Traffic:
    scenes = session.places["bendplatz"].scenes
    assert scenes is not None
    return scenes.at(session.start["scene"], session.start["step"] * DT)


def vehicles_of(traffic: Traffic) -> list[dict[str, Any]]:
    return [
        {
            "id": id,
            "route": traffic.intersection.routes[traffic.route[i]].id,
            **{name: float(getattr(traffic, name)[i]) for name in ("position", "speed", "length", "width")},
            "maxSpeed": float(traffic.max_speed[i]) if np.isfinite(traffic.max_speed[i]) else None,
        }
        for i, id in enumerate(traffic.ids)
    ]


def three() -> dict[str, Any]:
    """Three vehicles of which two yield, as the README has them."""
    rows = (("main", "SE-NW", 90.0, 12.0), ("side", "SW-NE", 75.0, 6.0), ("left", "NW-NE", 135.0, 6.0))
    traffic = Traffic.of(BENDPLATZ, [Vehicle(*row) for row in rows])
    return {"place": "bendplatz", "vehicles": vehicles_of(traffic)}


def test_it_opens_at_the_busiest_moment_of_the_busiest_scene(session: Session, moment: Traffic) -> None:
    scenes = session.places["bendplatz"].scenes
    assert scenes is not None
    there = [len(scenes.at(session.start["scene"], k * DT).conflicts) for k in range(0, session.start["step"], 5)]
    assert len(moment.conflicts) > max(there, default=0)
    assert session.opened()["start"] == session.start


def test_every_answer_is_json_without_numbers_that_json_has_not(session: Session) -> None:
    for kind in ("road", "scene", "predicted", "ranked"):
        json.dumps(session.answer(kind, session.start), allow_nan=False)
    json.dumps(session.opened(), allow_nan=False)


def test_a_prediction_is_the_most_probable_one_of_the_forecast(session: Session, moment: Traffic) -> None:
    answer = session.answer("predicted", session.start)
    likely = forecast(DEFAULT, moment, most=16)
    np.testing.assert_allclose(np.transpose(answer["position"]), likely.most_probable().position[0], atol=0.006)
    np.testing.assert_allclose(np.transpose(answer["fans"]["low"]), likely.position_quantiles((0.1,))[0], atol=0.006)
    assert answer["probability"] == pytest.approx(likely.probability[0], abs=1e-4)
    firsts = [pair["yielderFirst"] for pair in answer["pairs"]]
    np.testing.assert_allclose(firsts, likely.yielder_first, atol=1e-4)


def test_recorded_vehicles_and_the_same_ones_given_by_hand_are_predicted_alike(
    session: Session, moment: Traffic
) -> None:
    by_hand = {"place": "bendplatz", "vehicles": vehicles_of(moment)}
    for kind in ("predicted", "ranked"):
        assert session.answer(kind, by_hand) == session.answer(kind, session.start)


def test_a_listed_order_is_a_row_of_the_ranking_with_its_probability(session: Session, moment: Traffic) -> None:
    answer, table = session.answer("ranked", session.start), rank_maneuvers(DEFAULT, moment)
    likely = forecast(DEFAULT, moment)
    known = dict(zip(likely.words(), likely.probability, strict=True))
    assert answer["none"]["loss"] == pytest.approx(
        float(table[~table["intervention"]]["total_time_loss"].iloc[0]), abs=1e-3
    )
    for row in answer["rows"]:
        wanted = table.iloc[row["rank"] - 1]
        assert ", ".join(row["order"]) == wanted["order"]
        assert row["gain"] == pytest.approx(wanted["gain"], abs=1e-3)
        assert row["priorities"] == wanted["priorities"].tolist()
        if not row["atMost"]:
            assert row["probability"] == pytest.approx(known[wanted["order"]], abs=1e-4)
        else:
            assert wanted["order"] not in known
    listed = {", ".join(row["order"]) for row in answer["rows"]}
    assert likely.words()[0] in listed


def test_an_order_that_is_shown_goes_as_it_says(session: Session) -> None:
    request = three()
    for row in session.answer("ranked", request)["rows"]:
        answer = session.answer("predicted", request | {"priorities": row["priorities"]})
        shown = [pair["first"] for pair in answer["pairs"]]
        assert [one in (0, way) for one, way in zip(shown, row["priorities"], strict=True)] == [True] * len(shown)
        assert [pair["given"] for pair in answer["pairs"]] == row["priorities"]


def test_an_assigned_pair_binds_prediction_and_ranking(session: Session) -> None:
    request = three()
    free, bound = (session.answer("ranked", request | {"assigned": pairs}) for pairs in ([], [["side", "main"]]))
    assert bound["orders"] < free["orders"]
    answer = session.answer("predicted", request | {"assigned": [["side", "main"]]})
    ids = [one["id"] for one in answer["vehicles"]]
    (pair,) = [one for one in answer["pairs"] if {ids[one["yielder"]], ids[one["prioritized"]]} == {"side", "main"}]
    assert (pair["given"], pair["first"], pair["yielderFirst"]) == (1, 1, 1.0)
    place = answer["pairs"].index(pair)
    assert {row["priorities"][place] for row in bound["rows"]} == {1}
    assert {row["priorities"][place] for row in free["rows"]} == {-1, 1}


def test_gains_with_an_assigned_pair_are_against_that_pair_alone(session: Session) -> None:
    """What a planner asks for who has told one pair: what more would an order bring?"""
    request = three() | {"assigned": [["side", "main"]]}
    answer = session.answer("ranked", request)
    given = asked(session.places["bendplatz"].intersection, None, request)
    likely = forecast(DEFAULT, given.traffic, given.priorities)
    losses = likely.prediction.time_loss.sum(axis=1, dtype=np.float64)
    assert answer["none"]["loss"] == pytest.approx(float(likely.expected_time_loss().sum()), abs=1e-3)
    assert answer["none"]["gain"] == 0.0
    assert answer["none"]["loss"] != session.answer("ranked", three())["none"]["loss"]
    for row in answer["rows"]:
        assert row["gain"] == pytest.approx(answer["none"]["loss"] - row["loss"], abs=2e-3)
        more = likely.weight @ (losses - row["loss"] > answer["worthwhileGain"])
        assert row["worthwhile"] == pytest.approx(more, abs=1e-3)
        assert row["worthExecuting"] == (row["safe"] and row["gain"] > answer["worthwhileGain"])


def test_gains_of_a_policy_without_forecasts_are_against_its_one_prediction_of_what_is_assigned() -> None:
    session = Session([Place(Intersection.load("bendplatz"))], Predictor.load("idm"))
    request = three() | {"assigned": [["side", "main"]]}
    answer = session.answer("ranked", request)
    given = asked(session.places["bendplatz"].intersection, None, request)
    loss = float(session.predictor.predict(given.traffic, given.priorities).time_loss.sum())
    assert answer["none"]["loss"] == pytest.approx(loss, abs=1e-3)
    assert answer["rows"]
    for row in answer["rows"]:
        assert row["gain"] == pytest.approx(loss - row["loss"], abs=2e-3)
        assert row["worthwhile"] is None


@pytest.mark.parametrize("name", ["roundabout", "all_way_stop", "crossroads", "t_junction", "bendplatz"])
def test_every_order_of_every_map_can_be_shown_also_where_routes_meet_twice(name: str) -> None:
    intersection = Intersection.load(name)
    session = Session([Place(intersection)], DEFAULT)
    (place,) = session.opened()["places"]
    back = {route.entry: route for route in intersection.routes if route.entry == route.exit}
    leading_back = [
        one | {"route": back[one["id"]].id, "position": back[one["id"]].stop_line - 25.0}
        for one in place["example"]
        if one["id"] in back
    ]
    for vehicles in filter(None, (place["example"], leading_back)):
        request = {"place": name, "vehicles": vehicles}
        rows = session.answer("ranked", request)["rows"]
        assert rows
        for row in rows:
            answer = session.answer("predicted", request | {"priorities": row["priorities"]})
            assert [pair["given"] for pair in answer["pairs"]] == row["priorities"]
            assert len(answer["waits"]) == 51


def test_who_waits_is_held_and_waits_for_one_that_goes_first(session: Session) -> None:
    answer = session.answer("predicted", session.start)
    assert any(answer["waits"])
    first = {(pair["yielder"], pair["prioritized"])[:: -1 if pair["first"] > 0 else 1] for pair in answer["pairs"]}
    for step, pairs in enumerate(answer["waits"]):
        for waiting, awaited in pairs:
            assert step in answer["held"][waiting]
            assert (waiting, awaited) in first


def test_a_policy_without_an_order_network_ranks_by_prediction_and_has_neither_probabilities_nor_fans() -> None:
    session = Session([Place(BENDPLATZ)], Predictor.load("idm"))
    assert not session.opened()["forecasts"]
    answer = session.answer("predicted", three())
    assert answer["fans"] is None
    assert answer["probability"] is None
    ranking = session.answer("ranked", three())
    assert ranking["by"] == "prediction"
    assert [row["probability"] for row in ranking["rows"]] == [None] * ranking["orders"]
    assert all(row["unsafe"] is None for row in ranking["rows"])


def test_a_place_without_scenes_opens_with_a_car_from_each_arm() -> None:
    for name in ("roundabout", "all_way_stop", "t_junction"):
        session = Session([Place(Intersection.load(name))], DEFAULT)
        (place,) = session.opened()["places"]
        assert {one["id"] for one in place["example"]} == set(session.answer("road", {"place": name})["arms"])
        assert session.answer("ranked", {"place": name, "vehicles": place["example"]})["rows"]


def test_no_vehicles_are_predicted_too(session: Session) -> None:
    empty = {"place": "roundabout", "vehicles": []}
    assert session.answer("predicted", empty)["position"] == []
    assert session.answer("ranked", empty)["rows"] == []


def test_what_is_to_be_doubted_is_noted(session: Session) -> None:
    request = three()
    request["vehicles"][0]["speed"] = 60.0
    request["vehicles"].append(request["vehicles"][1] | {"id": "over"})
    answer = session.answer("predicted", request)
    (note,) = answer["notes"]
    assert "main" in note
    assert "km/h" in note
    assert answer["overlaps"] == [["side", "over"]]


WRONG: dict[str, tuple[str, dict[str, Any], str]] = {
    "kind": ("rank", {}, 'nothing answers "rank"'),
    "place": ("road", {"place": "nowhere"}, 'place "nowhere" is not open'),
    "no place": ("road", {}, '"place" is None; wanted a string'),
    "scene": ("scene", {"place": "bendplatz", "scene": "99/9"}, 'no scene "99/9"'),
    "no scenes": ("scene", {"place": "roundabout", "scene": "1"}, "nothing is recorded on roundabout"),
    "step": ("predicted", {"place": "bendplatz", "scene": "SCENE", "step": 1.5}, '"step" is 1.5'),
    "step beyond": ("predicted", {"place": "bendplatz", "scene": "SCENE", "step": 10**6}, "has states every 0.2 s"),
    "vehicles": ("predicted", {"place": "bendplatz", "vehicles": 3}, '"vehicles" must be a list'),
    "pairs": ("ranked", three() | {"assigned": [["side"]]}, "wanted a pair of ids"),
    "priorities": ("predicted", three() | {"priorities": [1]}, '"priorities" must be [0-9]+ numbers'),
    "unknown": ("ranked", three() | {"assigned": [["side", "who"]]}, 'no vehicle "who"'),
    "contrary": ("ranked", three() | {"assigned": [["side", "main"], ["main", "side"]]}, "each told to go before"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_refused_in_a_sentence(session: Session, name: str) -> None:
    kind, request, words = WRONG[name]
    if request.get("scene") == "SCENE":
        request = request | {"scene": session.start["scene"]}
    with pytest.raises(ValueError, match=words):
        session.answer(kind, request)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"route": "N-S"}, 'no route "N-S"'),
        ({"route": 3}, '"route" is 3'),
        ({"position": None}, 'vehicle main: "position" is None; wanted a number'),
        ({"position": 1e9}, "main"),
        ({"speed": -1.0}, "main"),
        ({"speed": True}, '"speed" is True'),
        ({"id": "side"}, "names two vehicles"),
        ({"id": ""}, "1 to 40 characters"),
    ],
)
def test_a_vehicle_that_cannot_be_is_refused_by_name(session: Session, values: dict[str, Any], words: str) -> None:
    request = three()
    request["vehicles"][0] |= values
    with pytest.raises(ValueError, match=words):
        session.answer("predicted", request)


def test_places_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="places are bendplatz, bendplatz"):
        Session([Place(BENDPLATZ), Place(BENDPLATZ)], DEFAULT)
    with pytest.raises(ValueError, match="places are none"):
        Session([], DEFAULT)
    scenes = Scenes.load("bendplatz")
    with pytest.raises(ValueError, match="nothing to show"):
        Session([Place(BENDPLATZ, replace(scenes, scenes=()))], DEFAULT)
    with pytest.raises(ValueError, match="nothing is recorded on these maps"):
        Session([Place(BENDPLATZ)], DEFAULT, time=3.0)
