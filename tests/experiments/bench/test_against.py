"""Two revisions side by side: both are asked for the same, in turns, and what one cannot do is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.bench.against import built, compared, main, rows, write_given
from experiments.bench.side import MEMORY, SAME, answer, read


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("given") / "given.npz"
    write_given(path)
    return path


@pytest.mark.parametrize(
    "row",
    [
        "predict, driver networks, n 1, isa v3, distances yes",
        "predict, driver assigned, n 64, isa v3",
        "predict, driver assigned, n 64, isa v3, together yes",
        "predict, driver idm, n 1, isa v3",
        "rank, orders 2000",
        "closed loop, worlds 8, isa v3, threads 2",
        "replay, worlds 8, isa v3",
        "replay, worlds 8, isa v3, gap recording",
    ],
)
def test_each_kind_of_row_takes_some_time_for_a_unit(given: Path, row: str) -> None:
    seconds = answer(read(given), row)()
    assert 1e-9 < seconds < 10.0


def test_every_row_is_of_a_known_kind() -> None:
    found = rows()
    assert len(set(found)) == len(found) > 60
    kinds = {row.split(", ")[0] for row in found}
    assert kinds == {"predict", "rank", "closed loop", "replay", MEMORY, SAME}
    with pytest.raises(ValueError, match='no row begins with "drive"; wanted predict'):
        answer({}, "drive, n 1")


def test_one_revision_is_as_fast_as_itself_and_predicts_the_same(given: Path) -> None:
    row = "predict, driver networks, n 64, isa v3"
    found = compared(row, (None, None), given, 2)
    assert found["row"] == row
    assert found["least"] <= found["ratio"] <= found["most"]
    assert 0.1 < found["ratio"] < 10.0
    assert found["then"] > 0.0
    same = f"{SAME}, isa v3"
    assert compared(same, (None, None), given, 2) == {"row": same, "equal": True}


def test_worlds_need_memory(given: Path) -> None:
    found = compared(f"{MEMORY}, of closed loop", (None, None), given, 1)
    assert found["then"] > 1e6
    assert 0.8 < found["ratio"] < 1.25


def test_side_that_fails_is_said(given: Path) -> None:
    with pytest.raises(RuntimeError, match=r"predict, driver horse.*: a side ended with exit status 1"):
        compared("predict, driver horse, n 1, isa v3", (None, None), given, 1)


def test_what_cannot_be_compared_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match='"no such commit" is no revision of this repository'):
        built("no such commit")
    assert main(["HEAD", "--row", "horse"]) == 1
    assert 'no row contains "horse"' in capsys.readouterr().err
    assert main(["HEAD", "--row", "rank", "--rounds", "0"]) == 1
    assert "--rounds is 0; wanted at least 1" in capsys.readouterr().err
