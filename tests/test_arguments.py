"""Names and files that are not there, or are something else: what is said names the argument and what ships."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from intersection_env import (
    ClosedLoop,
    ClosedLoopWorlds,
    Intersection,
    Predictor,
    Replay,
    ReplayVector,
    Scenes,
    crossing_orders,
    forecast,
    rank_maneuvers,
)
from intersection_env.maps import __main__ as compiling
from intersection_env.maps.intersection import MAPS
from intersection_env.policies.named import gap_decider
from intersection_env.traffic import Traffic, Vehicle

LOADERS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "map": (Intersection.load, "all_way_stop, bendplatz, crossroads, roundabout, t_junction"),
    "policy": (Predictor.load, "idm_calibrated, ppo, rollout_gradient, idm, constant_velocity"),
    "scenes": (Scenes.load, "bendplatz, crossroads, t_junction"),
    "gap": (gap_decider, "critical_gap, sumo, gail, gap"),
}


@pytest.mark.parametrize("value", [["bendplatz"], 3, None])
@pytest.mark.parametrize("name", LOADERS)
def test_what_is_no_name_and_no_path_is_refused_by_the_argument_s_name(name: str, value: object) -> None:
    load, ships = LOADERS[name]
    with pytest.raises(TypeError, match=f"^{name} is ") as caught:
        load(value)
    assert repr(value) in str(caught.value)
    assert ships in str(caught.value)


@pytest.mark.parametrize(
    ("name", "file"),
    [("map", "nope.map"), ("map", "nope.json"), ("policy", "nope.policy"), ("scenes", "nope.npz"), ("scenes", "nope")],
)
def test_a_file_that_is_not_there_is_named_beside_what_ships(name: str, file: str, tmp_path: Path) -> None:
    load, ships = LOADERS[name]
    with pytest.raises(FileNotFoundError) as caught:
        load(tmp_path / file)
    assert str(tmp_path / file) in str(caught.value)
    assert ships in str(caught.value)
    assert "Errno" not in str(caught.value)


def test_a_source_to_compile_that_is_not_there_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compiling.main([str(tmp_path / "nope.json")]) == 1
    said = capsys.readouterr().err
    assert str(tmp_path / "nope.json") in said
    assert "Errno" not in said


def test_maps_that_ship_are_compiled_anew_only_where_that_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "t_junction.json"
    source.write_bytes((MAPS / "t_junction.json").read_bytes())
    monkeypatch.setattr(compiling, "MAPS", tmp_path)
    for arguments in ([], ["--shipped", str(source)]):
        with pytest.raises(SystemExit) as ended:
            compiling.main(arguments)
        assert ended.value.code == 2
        assert "--shipped" in capsys.readouterr().err
        assert list(tmp_path.iterdir()) == [source]
    assert compiling.main(["--shipped"]) == 0
    assert source.with_suffix(".map").read_bytes() == (MAPS / "t_junction.map").read_bytes()


@pytest.mark.parametrize("make", [Replay, lambda **options: ReplayVector(4, **options)])
def test_environments_name_the_argument_that_is_wrong(make: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match=r"^scenes is \['bendplatz'\]; wanted a name"):
        make(scenes=["bendplatz"])
    with pytest.raises(TypeError, match=r"^map is 3; wanted a name"):
        make(map=3)
    with pytest.raises(TypeError, match=r"^gap is 3; wanted a name"):
        make(gap=3)


def test_closed_loops_name_the_argument_that_is_wrong() -> None:
    with pytest.raises(TypeError, match=r"^map is \['bendplatz'\]; wanted a name"):
        ClosedLoop(map=["bendplatz"])  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"^map is 3; wanted a name"):
        ClosedLoopWorlds(worlds=2, map=3)  # type: ignore[arg-type]


@pytest.mark.parametrize("make", [ClosedLoop, ClosedLoopWorlds, Replay, ReplayVector])
def test_words_that_are_none_are_refused_by_the_argument_s_name(make: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match=r"^bodies is None; wanted circles or rectangles"):
        make(bodies=None)


def test_batched_worlds_name_an_autoreset_that_is_no_word() -> None:
    with pytest.raises(TypeError, match=r"^autoreset is True; wanted off or same_step or next_step"):
        ClosedLoopWorlds(autoreset=True)  # type: ignore[arg-type]


TRAFFIC = Traffic.of(
    Intersection.load("bendplatz"), [Vehicle("a", "SE-NW", 90.0, 12.0), Vehicle("b", "SW-NE", 75.0, 6.0)]
)
DEFAULT = Predictor.load()
PREDICTOR: Any = DEFAULT
FORECAST: Any = forecast
RANK: Any = rank_maneuvers
ORDERS: Any = crossing_orders
"""The same, for calls that no type checker would let pass."""


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: RANK(TRAFFIC, DEFAULT), "predictor is of type Traffic; wanted a Predictor"),
        (lambda: FORECAST(TRAFFIC, DEFAULT), "predictor is of type Traffic; wanted a Predictor"),
        (lambda: FORECAST(DEFAULT, [Vehicle("a", "SE-NW", 90.0, 12.0)]), "traffic is of type list; wanted a Traffic"),
        (lambda: PREDICTOR.predict([]), "traffic is of type list; wanted a Traffic"),
        (lambda: PREDICTOR.observe("bendplatz"), "traffic is of type str; wanted a Traffic"),
        (lambda: PREDICTOR.patience_of(None), "traffic is of type NoneType; wanted a Traffic"),
        (lambda: next(ORDERS(DEFAULT)), "traffic is of type Predictor; wanted a Traffic"),
        (lambda: next(ORDERS(TRAFFIC, batch=2.5)), "batch is 2.5; wanted a whole number"),
        (lambda: FORECAST(DEFAULT, TRAFFIC, most=None), "most is None; wanted a whole number"),
        (lambda: FORECAST(DEFAULT, TRAFFIC, mass="0.9"), "mass is '0.9'; wanted a number"),
        (lambda: FORECAST(DEFAULT, TRAFFIC, seconds="1"), "seconds is '1'; wanted a number"),
        (lambda: RANK(DEFAULT, TRAFFIC, seconds=True), "seconds is True; wanted a number"),
    ],
)
def test_a_prediction_s_argument_of_another_type_is_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(TypeError, match=f"^{message}"):
        call()


def test_a_limit_that_is_another_word_is_refused_beside_those_there_are() -> None:
    with pytest.raises(ValueError, match=r"^limit is 'all'; wanted a whole number, None or \"cycle\""):
        rank_maneuvers(DEFAULT, TRAFFIC, limit="all")  # type: ignore[arg-type]


def test_forecasts_and_rankings_take_all_orders_alike() -> None:
    assert forecast(DEFAULT, TRAFFIC, limit=None).feasible == 2
    assert rank_maneuvers(DEFAULT, TRAFFIC, limit=None)["intervention"].sum() == 2


def test_a_traffic_wants_a_loaded_map() -> None:
    with pytest.raises(TypeError, match=r"^intersection is 'bendplatz'; wanted an Intersection"):
        Traffic.of("bendplatz", [Vehicle("a", "SE-NW", 90.0, 5.0)])  # type: ignore[arg-type]


@pytest.mark.parametrize("vehicle", ["a", ("a", "SE-NW", 95.0, 12.0)])
def test_a_traffic_wants_vehicles(vehicle: Any) -> None:
    with pytest.raises(TypeError, match=f"an entry that is of type {type(vehicle).__name__}; wanted a Vehicle"):
        Traffic.of(Intersection.load("bendplatz"), [vehicle])


def test_nobody_is_advised_to_unpickle(tmp_path: Path) -> None:
    np.save(tmp_path / "objects.npy", np.array([{}], dtype=object))
    np.savez(tmp_path / "objects.npz", header=np.array([{}], dtype=object))
    (tmp_path / "text.npz").write_text("hello")
    for path in tmp_path.iterdir():
        with pytest.raises(ValueError, match="not a scenes file") as caught:
            Scenes.load(path)
        assert "pickle" not in str(caught.value)


def test_scenes_are_shown_in_a_line() -> None:
    scenes = Scenes.load(Path("t_junction"))
    assert repr(scenes) == f"Scenes('t_junction', {len(scenes)} scenes)"
