"""Who crosses first: known from the recording, or not scored; right, or wrong."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.measure.crossing_order import Options, main, order_results, scored_pairs
from experiments.models.patient import patient
from experiments.show.crossing_order import BASELINES, order_table
from intersection_env import Intersection, Prediction, Predictor, Scene, Scenes, Traffic
from intersection_env.evaluation import intervals
from intersection_env.evaluation.errors import Forecaster
from intersection_env.evaluation.moments import HORIZONS, Moment, moments_of
from intersection_env.evaluation.recorded_order import recorded_order
from intersection_env.prediction.measures import crossing_order
from intersection_env.scenes.scene import Track

STEP, LENGTH, SPEED = 0.2, 4.5, 5.0
YIELDER, PRIORITIZED = "SW-NE", "NW-SE"  # they cross


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests of intervals are elsewhere."""
    monkeypatch.setattr(intervals, "RESAMPLES", 20)


@pytest.fixture(scope="module")
def bendplatz() -> Intersection:
    return Intersection.load("bendplatz")


def begins(bendplatz: Intersection) -> dict[str, float]:
    """Where the conflict of the two routes begins on each [m]."""
    own, other = bendplatz.route_index(YIELDER), bendplatz.route_index(PRIORITIZED)
    conflict = next(one for one in bendplatz.conflicts if (one.yielder, one.prioritized) == (own, other))
    return {YIELDER: conflict.on_yielder[0], PRIORITIZED: conflict.on_prioritized[0]}


def arriving(
    bendplatz: Intersection,
    id: str,
    route: str,
    step: int,
    count: int = 51,
    road_user: str = "car",
    extrapolated: int = 0,
) -> Track:
    """Drives at 5 m/s, and is at the conflict in that step for the first time; recorded for `count` steps."""
    time = np.arange(count, dtype=np.float64) - step
    position = begins(bendplatz)[route] - LENGTH / 2 + 0.1 + SPEED * STEP * time
    states = position.astype(np.float32), np.full(count, SPEED, np.float32), np.zeros(count, np.float32)
    observed = np.arange(count) >= extrapolated
    return Track(id, road_user, bendplatz.route_index(route), LENGTH, 1.8, 0, *states, observed)


def scene_of(tracks: Sequence[Track], recording: str = "07", steps: int = 51, split: str = "development") -> Scene:
    return Scene(f"{recording}/0", recording, split, 0.0, steps, tuple(tracks))


def first(bendplatz: Intersection, *scenes: Scene) -> list[Moment]:
    """The first moment of each scene."""
    moments = moments_of(Scenes(bendplatz, scenes, {}, {}))[0]
    return [moment for moment in moments if moment.step == 0]


def pair(bendplatz: Intersection, yielder: int, prioritized: int, recording: str = "07") -> Scene:
    """A scene of two cars that arrive in these steps."""
    tracks = [
        arriving(bendplatz, f"{recording}/1", YIELDER, yielder),
        arriving(bendplatz, f"{recording}/2", PRIORITIZED, prioritized),
    ]
    return scene_of(tracks, recording)


class Told:
    """Forecaster the positions that it is told, by traffic."""

    def __init__(self, name: str, positions: Mapping[int, NDArray[np.float32]]) -> None:
        self.name = name
        self._positions = positions
        self._idm = Predictor.load("idm")

    def predict(self, traffic: Traffic, /) -> Prediction:
        return replace(self._idm.predict(traffic), position=self._positions[id(traffic)])


def recordings_replayed(moments: Sequence[Moment], name: str = "recording") -> Forecaster:
    return Told(name, {id(moment.traffic): moment.recorded.data[None] for moment in moments})


def nobody_moves(moments: Sequence[Moment], name: str = "nobody_moves") -> Forecaster:
    return Told(name, {id(one.traffic): np.repeat(one.traffic.position[None, None], 51, 1) for one in moments})


@pytest.mark.parametrize(
    ("yielder", "prioritized", "expected", "step"),
    [(20, 21, 1, 20), (21, 20, -1, 20), (20, 20, -1, 20), (50, 53, 1, 50), (-1, 30, 1, 0)],
)
def test_recorded_order_is_who_first_reached_the_conflict(
    bendplatz: Intersection, yielder: int, prioritized: int, expected: int, step: int
) -> None:
    (moment,) = first(bendplatz, pair(bendplatz, yielder, prioritized))
    order, steps = recorded_order(moment)
    assert order.dtype == np.int8
    assert order.tolist() == [expected]
    assert steps.tolist() == [step]


@pytest.mark.parametrize(
    ("yielder", "prioritized", "expected"),
    [
        ((20, 51), (40, 31), 1),  # the other's track ends, but the first was there before
        ((20, 51), (40, 20), 0),  # it may have been there in the same step, and then it counts as the first
        ((20, 51), (40, 21), 1),
        ((20, 20), (40, 51), 0),  # a step before it would have been there, the yielder is lost
        ((40, 51), (30, 15), 0),  # the prioritized vehicle is lost before either was there
        ((40, 51), (10, 25), -1),  # or after it was
        ((52, 51), (51, 51), 0),  # neither within the horizon
        ((52, 51), (51, 15), 0),
        ((20, 15), (30, 15), 0),  # the scene ends first
    ],
)
def test_order_is_unknown_where_a_lost_vehicle_may_have_been_first(
    bendplatz: Intersection, yielder: tuple[int, int], prioritized: tuple[int, int], expected: int
) -> None:
    tracks = [arriving(bendplatz, "07/1", YIELDER, *yielder), arriving(bendplatz, "07/2", PRIORITIZED, *prioritized)]
    (moment,) = first(bendplatz, scene_of(tracks, steps=max(yielder[1], prioritized[1])))
    assert recorded_order(moment)[0].tolist() == [expected]


def test_pairs_of_unknown_order_are_not_scored(bendplatz: Intersection) -> None:
    lost = [arriving(bendplatz, "08/1", YIELDER, 40), arriving(bendplatz, "08/2", PRIORITIZED, 30, count=15)]
    known, unknown = first(bendplatz, pair(bendplatz, 20, 30), scene_of(lost, "08"))
    assert order_results([], [known, unknown])["all"]["pairs"] == 1
    with pytest.raises(ValueError, match="no pair of vehicles of known order in 1 moments"):
        order_results([], [unknown])


def test_recording_itself_is_always_right(bendplatz: Intersection) -> None:
    moments = first(bendplatz, *(pair(bendplatz, 30, 30 + k, f"{10 + k}") for k in (-15, -2, 0, 3, 18)))
    models = order_results([recordings_replayed(moments)], moments)["recorded"]["models"]
    one = models["recording"]
    assert one["accuracy"] == {"value": 1.0, "low": 1.0, "high": 1.0}
    assert one["unresolved"] == 0.0
    assert models["priority_first"]["accuracy"]["value"] == pytest.approx(3 / 5)  # a tie goes to the prioritized
    assert one["minus"]["priority_first"]["value"] == pytest.approx(2 / 5)
    assert one["minus"]["sumo_rule"]["value"] == pytest.approx(1.0 - models["sumo_rule"]["accuracy"]["value"])
    assert "priority_first" not in models["priority_first"]["minus"]


def test_unresolved_order_is_wrong_whichever_came_first(bendplatz: Intersection) -> None:
    moments = first(bendplatz, pair(bendplatz, 20, 30), pair(bendplatz, 30, 20, "08"))
    found = order_results([nobody_moves(moments)], moments)["all"]["models"]["nobody_moves"]
    assert found["accuracy"]["value"] == 0.0
    assert found["unresolved"] == 1.0


def test_bicycles_take_part_but_their_pairs_are_not_scored(bendplatz: Intersection) -> None:
    car, truck = (
        arriving(bendplatz, f"07/{k}", YIELDER, 20 + 15 * k, road_user=user)
        for k, user in ((0, "car"), (1, "truck_bus"))
    )
    bicycle = arriving(bendplatz, "07/9", PRIORITIZED, 30, road_user="bicycle")
    other = arriving(bendplatz, "07/8", PRIORITIZED, 45)
    (moment,) = first(bendplatz, scene_of([car, truck, bicycle, other]))
    seen: list[int] = []

    class Watching(Told):
        def predict(self, traffic: Traffic, /) -> Prediction:
            seen.append(len(traffic))
            return super().predict(traffic)

    watching = Watching("watching", {id(moment.traffic): moment.recorded.data[None]})
    results = order_results([watching], [moment])
    assert len(moment.traffic.conflicts) == 4
    assert results["all"]["pairs"] == 2
    assert seen == [4]


def test_pairs_with_a_vehicle_extrapolated_at_the_start_count_only_among_all(bendplatz: Intersection) -> None:
    late = arriving(bendplatz, "08/2", PRIORITIZED, 20, extrapolated=3)
    moments = first(
        bendplatz,
        pair(bendplatz, 20, 30),
        scene_of([arriving(bendplatz, "08/1", YIELDER, 30), late], "08"),
    )
    results = order_results([], moments)
    assert (results["recorded"]["pairs"], results["all"]["pairs"]) == (1, 2)
    # in the first the yielder came first, in the second the prioritized vehicle
    accuracy = [results[one]["models"]["priority_first"]["accuracy"]["value"] for one in ("recorded", "all")]
    assert accuracy == [0.0, 0.5]


def test_settled_pairs_count_in_the_accuracy_alone_and_others_by_who_arrived_first_and_when(
    bendplatz: Intersection,
) -> None:
    arrivals = [(-1, 30), (1, 30), (10, 30), (11, 30), (30, 50), (50, 49)]
    scenes = [pair(bendplatz, *steps, recording=f"{10 + k}") for k, steps in enumerate(arrivals)]
    found = order_results([], first(bendplatz, *scenes))["recorded"]
    assert (found["pairs"], found["settled"]) == (6, 1)
    model = found["models"]["priority_first"]
    assert model["accuracy"]["value"] == pytest.approx(1 / 6, abs=1e-4)
    assert model["open_accuracy"]["value"] == pytest.approx(1 / 5)
    by_first = {first: (one["pairs"], one["accuracy"]["value"]) for first, one in model["by_first"].items()}
    assert by_first == {"yielder": (4, 0.0), "prioritized": (1, 1.0)}
    assert [one["until"] for one in model["by_time"]] == list(HORIZONS)
    assert [one["pairs"] for one in model["by_time"]] == [2, 1, 1, 0, 1]
    assert [one["accuracy"] and one["accuracy"]["value"] for one in model["by_time"]] == [0.0, 0.0, 0.0, None, 1.0]


def test_baselines_are_the_rules_that_they_are_named_for(bendplatz: Intersection) -> None:
    scenes = [pair(bendplatz, own, other, f"{own}{other}") for own in range(5, 50, 9) for other in range(5, 50, 3)]
    predicted = scored_pairs([], first(bendplatz, *scenes)).predicted
    assert set(predicted) == set(BASELINES)
    assert (predicted["priority_first"] == -1).all()
    traffics = [moment.traffic for moment in first(bendplatz, *scenes)]
    rules = {"sumo_rule": Predictor.load("idm", gap="sumo"), "critical_gap": Predictor.load("idm")}
    for name, rule in rules.items():
        own = [crossing_order(traffic, rule.predict(traffic))[0, 0] for traffic in traffics]
        assert predicted[name].tolist() == own
    assert (predicted["sumo_rule"] != predicted["critical_gap"]).any()


def test_two_models_of_one_name_are_refused(bendplatz: Intersection) -> None:
    moments = first(bendplatz, pair(bendplatz, 20, 30))
    with pytest.raises(ValueError, match='"sumo_rule" names two models'):
        order_results([Predictor(Predictor.load("gap").policy, "sumo_rule")], moments)


def test_results_of_the_split_asked_for_are_written_and_printed(
    bendplatz: Intersection, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    others = [
        replace(pair(bendplatz, 30, 20, f"{k:02}"), split=split) for k, split in ((8, "train"), (9, "validation"))
    ]
    scenes = Scenes(bendplatz, (pair(bendplatz, 20, 30), *others), {}, {})
    scenes.save(tmp_path / "scenes.npz")
    options = Options(scenes=(tmp_path / "scenes.npz",), policies=("gap",), patient=("gap",), out=tmp_path)
    assert main(options) == 0
    content = json.loads((tmp_path / "order_development.json").read_text(encoding="utf-8"))
    own, _ = moments_of(scenes.select("development"))
    expected = order_results([Predictor.load("gap"), patient(Predictor.load("gap"))], own)
    assert content == {"split": "development", "refused": 0, **expected}
    assert content["recordings"] == 1
    assert capsys.readouterr().out.strip() == order_table(expected)


def test_missing_scenes_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Options(scenes=(Path("nowhere.npz"),))) == 1
    assert "nowhere.npz" in capsys.readouterr().err
