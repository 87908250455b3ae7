"""All that ships is scored on somebody's recordings, on one page; what cannot be scored is said there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from experiments.measure.real import Options, main, rules, shipped
from experiments.show.real import real_page
from intersection_env import Scenes
from intersection_env.evaluation import intervals
from intersection_env.policies.named import POLICIES
from tests.support.own_place import LOCATION, own_map, own_recordings
from tests.support.recordings import on_route, steady, write_recording


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intervals, "RESAMPLES", 20)


@pytest.fixture
def own(tmp_path: Path) -> Options:
    map = own_map(tmp_path)
    return Options(own_recordings(tmp_path / "in", map, "40", "41"), (str(map),), tmp_path / "out")


def test_every_policy_and_rule_is_scored_and_the_page_shows_each(
    own: Options, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(own) == 0
    assert sorted(path.name for path in own.out.iterdir()) == ["mine.npz", "real.html", "real.json", "real.md"]
    text = (own.out / "real.md").read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    names = [one.name for one in (*rules(), *shipped())]
    assert names == [*dict.fromkeys(names)]
    assert {path.stem for path in POLICIES.glob("*.policy")} < set(names)
    assert {"constant_velocity", "idm_critical_gap", "idm_sumo"} < set(names)
    place = json.loads((own.out / "real.json").read_text(encoding="utf-8"))["places"]["mine"]
    for name in names:
        assert f"| {name} |" in text
        assert any(row["model"] == name for row in place["errors"])
    assert [one["id"] for one in place["recordings"]] == ["40", "41"], "whatever their split"
    assert len(Scenes.load(own.out / "mine.npz", own.map[0])) == place["scenes"] == 2
    still = [row for row in place["errors"] if (row["model"], row["population"]) == ("constant_velocity", "recorded")]
    assert still[0]["rmse"] < 0.3, "all drive steadily"
    for said in (
        "priority first",
        "always wait",
        "(*recorded*)",
        "(*extrapolated*)",
        "| extrapolated into the past | inside",
        "| S-W | 2 |",
    ):
        assert said in text
    assert "**Few samples**" in text
    assert "**Intervals** are over recordings, and there are 2" in text
    html = (own.out / "real.html").read_text(encoding="utf-8")
    assert "<title>intersection_env: Own recordings</title>" in html
    assert html.count("<table>") == text.count("| --- |\n") + text.count("|---|\n")


def test_what_there_is_too_little_of_is_said_and_nothing_fails(
    own: Options, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One car alone; then nobody long enough to make a scene of."""
    from intersection_env import Intersection

    map = Intersection.load(own.map[0])
    for seconds, said in ((13.0, "no pair of vehicles of known order"), (5.0, "no moment to predict from")):
        folder = tmp_path / f"{seconds}"
        write_recording(folder, "40", [on_route(map, "W-E", 1, 0.0, steady(60.0, 8.0), seconds)], LOCATION)
        assert main(Options(folder, own.map, tmp_path / "out")) == 0
        text = capsys.readouterr().out
        assert f"**Cannot be scored: crossing orders.** {said}" in text
        assert text.count("**Cannot be scored: gap decisions") == 2
        assert "nan" not in text
    assert "**Cannot be scored: predictions.**" in text
    assert "| stretches cut out | shorter than 12 s | 1 |" in text


def test_recordings_that_ship_are_said_to_be_no_test(own: Options) -> None:
    assert main(own) == 0
    results = json.loads((own.out / "real.json").read_text(encoding="utf-8"))
    assert "this is no test of them" not in real_page(results)
    assert "this is no test of them" in real_page(results | {"is_shipped": True})


def test_recordings_without_a_map_are_refused(own: Options, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Options(own.recordings, (), own.out)) == 1
    assert f"the recordings are of location {LOCATION}" in capsys.readouterr().err
    assert not own.out.exists()
