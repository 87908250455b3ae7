"""The environments' page is what their docstrings say, and what these say is so."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from PIL import Image

from experiments.documentation.environments import PAGE, PICTURES, closed_loop_picture, page, replay_picture
from experiments.documentation.features import figure
from intersection_env import ClosedLoop, Replay, _core
from tests.envs.test_closed_loop_env import GAPS

TABLE = re.compile(r"^ *\| (\d+) \| .* \| (.*?) \| (.*?) \|$", flags=re.MULTILINE)
BOUNDS = {"π": np.pi, "-π": -np.pi}


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


def test_gap_rules_of_the_manual_are_those_of_the_tests() -> None:
    for gap in GAPS:
        assert f'`"{gap}"`' in str(ClosedLoop.__doc__)
