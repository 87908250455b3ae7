"""The environments' page is what their docstrings say, and what these say is so."""

from __future__ import annotations

import re
from types import CodeType
from typing import Any

import numpy as np
import pytest
from PIL import Image

from experiments.documentation.environments import PAGE, PICTURES, closed_loop_picture, page, replay_picture
from experiments.documentation.features import figure
from intersection_env import ClosedLoop, ClosedLoopWorlds, Replay, _core
from intersection_env.features import Driving
from tests.support.doors import GAPS

TABLE = re.compile(r"^ *\| (\d+) \| .* \| (.*?) \| (.*?) \|$", flags=re.MULTILINE)
BOUNDS = {"π": np.pi, "-π": -np.pi}


REWARD_ROW = re.compile(r"^\| (.*) \| (-?\d.*) \|$", flags=re.MULTILINE)
STEPS = 30


def bound(text: str) -> float:
    return BOUNDS.get(text) or float(text)


def test_page_is_as_the_docstrings_make_it() -> None:
    """Regenerate with `python -m experiments.documentation.environments`."""
    assert PAGE.read_text() == page()


def test_page_shows_pictures_that_are_there() -> None:
    named = set(re.findall(r"\(pictures/(.*?)\)", page()))
    assert named == {"closed_loop.png", "replay.png", "features.png"}
    for name in named:
        assert (PICTURES / name).is_file()


@pytest.mark.parametrize(("name", "draw"), [("closed_loop", closed_loop_picture), ("replay", replay_picture)])
def test_pictures_are_as_the_environments_draw_them(name: str, draw: Any) -> None:
    with Image.open(PICTURES / f"{name}.png") as shown:
        assert (np.asarray(shown) == draw()).mean() > 0.99


def test_feature_figure_shows_what_the_core_measures() -> None:
    texts = [text.get_text() for axes in figure().axes for text in axes.texts]
    assert sum("d_{stop}" in text for text in texts) == 2
    assert sum("d_{PGA}" in text for text in texts) == 1
    assert sum(text.endswith("°") for text in texts) == 6
    assert any("δ = 0: has to wait" in text for text in texts)


@pytest.mark.parametrize("kind", [ClosedLoop, Replay])
def test_observation_table_has_the_bounds_of_the_space(kind: Any) -> None:
    environment = kind()
    space = environment.observation_space
    space = space("vehicle_0") if callable(space) else space
    rows = TABLE.findall(kind.__doc__)
    assert [int(index) for index, _, _ in rows] == list(range(len(_core.driving_features())))
    for (_, low, high), least, most in zip(rows, space.low, space.high, strict=True):
        assert bound(low) == pytest.approx(least, abs=0.06)
        assert bound(high) == pytest.approx(most, abs=0.06)


def test_both_manuals_tell_the_same_of_the_reward() -> None:
    tables = [
        re.search(r"\| base \| 2 \|.*?-5000 \|", str(kind.__doc__), flags=re.DOTALL) for kind in (ClosedLoop, Replay)
    ]
    assert tables[0] is not None
    assert tables[1] is not None
    assert tables[0][0] == tables[1][0]


def test_reward_stands_once_on_the_page() -> None:
    assert page().count("| base | 2 |") == 1
    assert len(re.findall(r"^### Reward\n\n\[The same\]\(#the-reward\)", page(), flags=re.MULTILINE)) == 2


def test_manuals_that_differ_about_the_reward_make_no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Replay, "__doc__", str(Replay.__doc__).replace("| base | 2 |", "| base | 3 |"))
    with pytest.raises(ValueError, match="must say the same of the reward"):
        page()


def test_reward_of_the_table_is_what_the_core_pays() -> None:
    """Row by row as the page says it, over worlds with random actions in which every row occurs."""
    rows = reward_rows(page())
    assert len(rows) == 10
    worlds = ClosedLoopWorlds(worlds=32)
    worlds.reset(seed=5, desynchronise=True)
    random = np.random.default_rng(5)
    met = np.zeros(len(rows), np.int64)
    for _ in range(STEPS):
        worlds.action[:] = random.uniform(-1.0, 1.0, worlds.action.shape).astype(np.float32)
        worlds.step()
        cut = worlds.terminated | worlds.truncated | worlds.reinserted
        seen = np.where(cut[..., None], worlds.final_observation, worlds.observation)
        for k in np.ndindex(worlds.action.shape):
            names = quantities(seen[k], 6.0 * float(worlds.action[k]), bool(worlds.terminated[k]))
            terms = [eval(value, names) if eval(condition, names) else 0.0 for condition, value in rows]
            assert float(worlds.reward[k]) == pytest.approx(sum(terms), rel=1e-4, abs=1e-3)
            met += np.array(terms) != 0.0
    assert met.min() > 0


def reward_rows(text: str) -> list[tuple[CodeType, CodeType]]:
    """When each row of the table counts, and what it then is, as Python over the names in `quantities`."""
    table = text.split("## The reward\n")[1].split("v_min = ")[0]
    rows = []
    for left, value in REWARD_ROW.findall(table):
        term, _, condition = left.partition(", ")
        always = "is_to_blame" if term == "to blame for a collision" else "True"
        rows.append((as_python(condition or always), as_python(value)))
    return rows


def as_python(formula: str) -> CodeType:
    formula = formula.replace("\\|", "|").replace(" m/s²", "").replace("²", "**2").replace(" = ", " == ")
    formula = re.sub(r"\|(\w+)\|", r"abs(\1)", formula)
    return compile(re.sub(r"(\d) (?=[a-z(])(?!and)", r"\1 * ", formula), formula, "eval")


def quantities(seen: Any, acceleration: float, is_to_blame: bool) -> dict[str, Any]:
    """What the table names, of one vehicle; seen: (12,). Who backs does not brake; d counts from 0 on."""
    d_stop, v, v_max, d_lead, delta = (
        float(seen[column])
        for column in (
            Driving.DISTANCE_TO_STOP_LINE,
            Driving.SPEED,
            Driving.V_MAX,
            Driving.LEAD_DISTANCE,
            Driving.ENTERS,
        )
    )
    d = d_lead if delta else min(d_lead, d_stop)
    return {
        "a": acceleration,
        "v": v,
        "v_max": v_max,
        "v_min": min(v_max, np.sqrt(2.0 * max(0.0, d))),
        "d_stop": d_stop,
        "d_lead": d_lead,
        "s_brake": max(0.0, v) ** 2 / (2.0 * 4.0),
        "delta": delta,
        "is_to_blame": is_to_blame,
    }


def test_gap_rules_of_the_manual_are_those_of_the_tests() -> None:
    for gap in GAPS:
        assert f'`"{gap}"`' in str(ClosedLoop.__doc__)
