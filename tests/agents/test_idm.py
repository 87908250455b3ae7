"""The IDM's parameters: in the core as in the twin, and found again by the calibration."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from agents import idm as calibration
from agents.idm import BOUNDS, calibrate
from intersection_env import Intersection, Predictor, Scene, Scenes, Traffic, Vehicle
from intersection_env.evaluation.errors import SPEEDS, distance_error
from intersection_env.evaluation.moments import moments_of
from intersection_env.policies.file import IdmParameters, PolicyFile
from intersection_env.scenes.scene import Track
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.support.core_and_twin import core_predictor, replayed
from tests.support.damage import with_checksum
from tests.support.scenes import small_scenes
from tests.support.twins import CASES, random_assignment, random_case

SLOW = IdmParameters(2.0, 1.6, 1.5, 2.0, 8.0, 0.8, 2.0)


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", range(6 * CASES))
def test_core_equals_twin_with_other_parameters(name: str, seed: int) -> None:
    generator = np.random.default_rng(seed)
    drawn = [float(np.float32(generator.uniform(*BOUNDS[key]))) for key in BOUNDS]
    parameters = IdmParameters(**dict(zip(BOUNDS, drawn, strict=True)))
    gap, headway, acceleration, deceleration, share, lateral = drawn
    twin_parameters = reference.Idm(gap, headway, acceleration, deceleration, 8.0, share, lateral)
    traffic, twin = random_case(name, 5000 + seed)
    policy = PolicyFile("critical_gap", "idm", idm=parameters)
    assignment = random_assignment(traffic, generator)
    how = {"gap": "critical_gap", "driver": "idm", "idm_parameters": twin_parameters}
    replayed(traffic, twin, core_predictor(traffic, policy), assignment, **how)


def test_it_brakes_for_a_curve_and_keeps_to_the_lateral_acceleration() -> None:
    traffic = Traffic.of(Intersection.load("bendplatz"), [Vehicle("a", "NW-SW", 100.0, 13.0)])
    slow = PolicyFile("critical_gap", "idm", idm=dataclasses.replace(IdmParameters(), lateral_acceleration=2.0))
    curves, plain = (Predictor(policy, "idm").predict(traffic) for policy in (slow, PolicyFile("sumo", "idm")))
    assert curves.speed.min() < 5.5, "the turn has a radius of 7 to 12 m"
    assert plain.speed.min() > 8.0


@pytest.mark.parametrize("line", ["idm 1.5 1 2.5 4 8 1", "idm 1.5 1 2.5 4 8 1 0", "idm 1.5 -1 2.5 4 8 1 1000"])
def test_a_policy_with_impossible_parameters_is_refused(tmp_path: Path, line: str) -> None:
    text = PolicyFile("sumo", "idm").text()
    body = text[: text.rindex("checksum ")].replace("idm 1.5 1 2.5 4 8 1 1000", line)
    (tmp_path / "x.policy").write_text(with_checksum(body))
    with pytest.raises(ValueError, match=r"7 numbers were expected|must be above 0"):
        Predictor.load(tmp_path / "x.policy")


def scenes_driven_by(parameters: IdmParameters) -> Scenes:
    """Scenes of 10 s in which three cars drive by these parameters."""
    bendplatz = Intersection.load("bendplatz")
    predictor = Predictor(PolicyFile("critical_gap", "idm", idm=parameters), "idm")
    scenes = []
    for number in range(6):
        rows = [
            Vehicle(f"07/{number}1", "NW-SW", 90.0 + number, 8.0),
            Vehicle(f"07/{number}2", "NW-SE", 60.0, 12.0 - number),
            Vehicle(f"07/{number}3", "SE-NW", 70.0, 5.0 + number),
        ]
        future = predictor.predict(Traffic.of(bendplatz, rows))
        tracks = []
        for k, row in enumerate(rows):
            states = future.position[0, :, k].copy(), future.speed[0, :, k].copy(), future.acceleration[0, :, k].copy()
            route = bendplatz.route_index(row.route)
            tracks.append(Track(row.id, "car", route, row.length, row.width, 0, *states, np.ones(51, np.bool_)))
        scenes.append(Scene(f"07/{number}", "07", "train", 0.0, 51, tuple(tracks)))
    return Scenes(bendplatz, tuple(scenes), {}, {})


def test_vehicles_driven_by_some_parameters_are_predicted_best_by_these() -> None:
    asked = moments_of(scenes_driven_by(SLOW), 4.0)[0]
    assert len(asked) == 18
    rule = PolicyFile("critical_gap", "idm")
    with_slow = Predictor(dataclasses.replace(rule, idm=SLOW), "idm")
    assert distance_error(with_slow, asked) < 0.5, "held vehicles remember, and those of a later start do not"
    before = distance_error(Predictor(rule, "idm"), asked)
    found = calibrate(asked, rule, rounds=4, progress=False)
    after = distance_error(Predictor(dataclasses.replace(rule, idm=found), "idm"), asked)
    assert after < 0.3 * before


def test_the_command_writes_a_policy_with_its_provenance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(calibration, "POPULATION", 1)
    small_scenes("train", "development").save(tmp_path / "scenes.npz")
    out = tmp_path / "idm.policy"
    told = ["--scenes", str(tmp_path / "scenes.npz"), "--rounds", "1", "--every", "20", "--out", str(out)]
    assert calibration.main(told) == 0
    assert "development" in capsys.readouterr().out
    about = PolicyFile.read(out).about
    assert about["distance_error"]["calibrated"]["train"] <= about["distance_error"]["paper"]["train"]
    assert set(about["until_last_seen"]) == {"calibrated", "constant_velocity"}
    assert set(about["until_last_seen"]["calibrated"]) == {"rmse", "mad", "bias", *SPEEDS}
    small_scenes("validation").save(tmp_path / "scenes.npz")
    assert calibration.main(told) == 1
    assert "no moment to predict from" in capsys.readouterr().err
