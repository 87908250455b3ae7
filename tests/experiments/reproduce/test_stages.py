"""A stage is done once and no more than needed; processes end with whoever started them."""

from __future__ import annotations

import itertools
import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from experiments.reproduce import stages
from experiments.reproduce.stages import (
    LAST_LINES,
    StageFailedError,
    Stages,
    exit_status_of,
    run_module,
    run_trainings,
)
from experiments.reproduce.workspace import Options, Workspace

PATIENCE = 30.0  # [s]
SCRIPTS = {
    "trains": """
import json, os, sys, time
from pathlib import Path
from agents.training.interrupt import told_to_end

run, epochs = Path(sys.argv[1]), int(sys.argv[2])
begin = time.monotonic()
with told_to_end() as told, (run / "metrics.jsonl").open("a") as metrics:
    (run / "pid").write_text(str(os.getpid()))
    for epoch in range(1, epochs + 1):
        time.sleep(0.02)
        print(json.dumps({"epoch": epoch}), file=metrics, flush=True)
        (run / "checkpoint").write_text(str(epoch))
        if told():
            sys.exit(128 + told())
(run / "time").write_text(json.dumps([begin, time.monotonic()]))
""",
    "fails": """
import sys, time
from pathlib import Path

while not all(Path(one).exists() for one in sys.argv[1:]):
    time.sleep(0.01)
for k in range(20):
    print("line", k, flush=True)
sys.exit("no such luck")
""",
    "listens_to_nobody": """
import os, signal, sys, time
from pathlib import Path

signal.signal(signal.SIGINT, signal.SIG_IGN)
(Path(sys.argv[1]) / "pid").write_text(str(os.getpid()))
time.sleep(60.0)
""",
    "leaves": "import sys; sys.exit(int(sys.argv[1]))",
}
FOREVER = "100000"  # epochs


@pytest.fixture(autouse=True)
def scripts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Small modules for `python -m`, looked at often; and Ctrl-C as it is outside of a test runner."""
    for name, text in SCRIPTS.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(stages, "WATCH_EVERY", 0.02)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Counter:
    """A stage's work, which says how often it was done."""

    def __init__(self, output: Path) -> None:
        self.output, self.count = output, 0

    def __call__(self) -> None:
        self.count += 1
        self.output.write_text("done", encoding="utf-8")


def test_stage_is_done_once_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    work = Counter(tmp_path / "out")
    first = Stages(tmp_path).run("a", {"x": 1}, work.output, work)
    assert Stages(tmp_path).run("a", {"x": 1}, work.output, work) == first
    assert work.count == 1
    assert capsys.readouterr().out == "[a]\n[a] was done before\n"
    assert 0.0 <= Stages(tmp_path).seconds(["a"])["a"] < PATIENCE


@pytest.mark.parametrize("content", [None, "by another"])
def test_stage_is_done_again_if_its_output_is_gone_or_another(tmp_path: Path, content: str | None) -> None:
    work = Counter(tmp_path / "out")
    Stages(tmp_path).run("a", {}, work.output, work)
    work.output.unlink() if content is None else work.output.write_text(content, encoding="utf-8")
    Stages(tmp_path).run("a", {}, work.output, work)
    assert work.count == 2
    assert work.output.read_text(encoding="utf-8") == "done"


def test_stage_is_done_again_if_inputs_change_and_so_are_those_after_it(tmp_path: Path) -> None:
    works = {name: Counter(tmp_path / name) for name in ("first", "second", "apart")}

    def run(value: int) -> list[int]:
        workspace = Workspace(Options(work=tmp_path))
        workspace.stage("first", [], works["first"].output, works["first"], value=value)
        workspace.stage("second", ["first"], works["second"].output, works["second"])
        workspace.stage("apart", [], works["apart"].output, works["apart"])
        assert set(workspace.seconds()) == set(works)
        return [work.count for work in works.values()]

    assert run(1) == [1, 1, 1]
    assert run(1) == [1, 1, 1]
    assert run(2) == [2, 2, 1]


def test_stage_that_fails_is_not_marked_nor_is_what_it_was_before(tmp_path: Path) -> None:
    work = Counter(tmp_path / "out")

    def fail() -> None:
        raise ValueError("no")

    for _ in range(2):
        Stages(tmp_path).run("a", {"x": 1}, work.output, work)
        with pytest.raises(ValueError, match="no"):
            Stages(tmp_path).run("a", {"x": 2}, work.output, fail)
    assert work.count == 2


def test_stage_that_was_interrupted_has_taken_all_its_tries(tmp_path: Path) -> None:
    work = Counter(tmp_path / "out")

    def interrupted() -> None:
        time.sleep(0.2)
        raise KeyboardInterrupt

    def seconds_after(tries: int, value: int) -> float:
        for _ in range(tries):
            with pytest.raises(KeyboardInterrupt):
                Stages(tmp_path).run("a", {"x": value}, work.output, interrupted)
        Stages(tmp_path).run("a", {"x": value}, work.output, work)
        return Stages(tmp_path).seconds(["a"])["a"]

    assert seconds_after(2, value=1) >= 0.4
    with pytest.raises(KeyboardInterrupt):
        Stages(tmp_path).run("a", {"x": 2}, work.output, interrupted)
    assert seconds_after(0, value=3) < 0.2  # of another stage's try it knows nothing


def test_trainings_for_other_scenes_or_of_other_effort_have_folders_of_their_own(tmp_path: Path) -> None:
    def folder(options: Options, recordings: str) -> Path:
        workspace = Workspace(options)
        workspace.stage(
            "scenes_bendplatz", [], tmp_path / "scenes", Counter(tmp_path / "scenes"), recordings=recordings
        )
        return workspace.run_of("ppo_0")

    options = Options(map=("bendplatz",), work=tmp_path)
    first = folder(options, "these")
    assert first.name == "ppo_0"
    assert folder(replace(options, seeds=(0, 1, 2, 3)), "these") == first
    assert len({first, folder(options, "those"), folder(replace(options, effort=0.5), "these")}) == 3


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (Options(seeds=()), "--seeds names no seed"),
        (Options(effort=0.0), "--effort is 0; wanted more than 0"),
        (Options(effort=float("nan")), "--effort is nan"),
        (Options(scenes_timed=0), "--scenes-timed is 0; wanted at least 1"),
    ],
)
def test_bad_options_are_refused_at_once(options: Options, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Workspace(options)


def test_module_that_ends_with_an_error_gives_its_status() -> None:
    run_module("leaves", "0")
    with pytest.raises(StageFailedError, match="python -m leaves 7 ended with exit status 7") as failure:
        run_module("leaves", "7")
    assert failure.value.status == 7


def test_ctrl_c_lets_a_module_end_as_it_wants_to(tmp_path: Path) -> None:
    def press() -> None:
        wait_for(tmp_path / "pid")
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        run_module("trains", str(tmp_path), FOREVER)
    thread.join()
    assert_ended_whole(tmp_path)


def wait_for(*paths: Path) -> None:
    end = time.monotonic() + PATIENCE
    while not all(path.exists() and path.stat().st_size for path in paths):
        assert time.monotonic() < end, f"none of {paths} comes"
        time.sleep(0.01)


def assert_ended_whole(run: Path) -> None:
    """Whether a training that would last forever has ended, with the checkpoint of its last whole epoch."""
    with pytest.raises(ProcessLookupError):
        os.kill(int((run / "pid").read_text()), 0)
    rows = (run / "metrics.jsonl").read_text().splitlines()
    assert json.loads(rows[-1])["epoch"] == int((run / "checkpoint").read_text())


def runs(tmp_path: Path, *names: str) -> list[Path]:
    return [tmp_path / "runs" / name for name in names]


def at_each_look(monkeypatch: pytest.MonkeyPatch, look: Callable[[], None]) -> None:
    """Calls it whenever `run_trainings` has waited a moment."""

    def sleep(seconds: float) -> None:
        time.sleep(seconds)
        look()

    monkeypatch.setattr(stages, "time", SimpleNamespace(sleep=sleep, perf_counter=time.perf_counter))


@pytest.mark.parametrize("at_once", [1, 2])
def test_trainings_run_side_by_side_but_no_more_than_allowed_and_all_finish(tmp_path: Path, at_once: int) -> None:
    folders = runs(tmp_path, "a", "b", "c")
    run_trainings({run: ["trains", str(run), "10"] for run in folders}, 10, at_once)
    times = [json.loads((run / "time").read_text()) for run in folders]
    together = [sum(begin <= moment < end for begin, end in times) for moment, _ in times]
    assert max(together) <= at_once
    if at_once == 1:
        assert all(one[1] <= other[0] for one, other in itertools.pairwise(times))


def test_training_that_fails_says_its_last_lines_and_ends_the_others_whole(tmp_path: Path) -> None:
    good, bad = runs(tmp_path, "good", "bad")
    with pytest.raises(StageFailedError) as failure:
        run_trainings({good: ["trains", str(good), FOREVER], bad: ["fails", str(good / "checkpoint")]}, 1000, 2)
    lines = str(failure.value).splitlines()
    assert lines[0] == f"line {20 - LAST_LINES + 1}"
    assert lines[-2:] == ["no such luck", f"the training in {bad} ended with exit status 1"]
    assert failure.value.status == 1
    assert_ended_whole(good)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_a_kill_and_a_closed_terminal_leave_no_training_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    before = signal.signal(number, signal.SIG_DFL if number != signal.SIGINT else signal.default_int_handler)
    folders = runs(tmp_path, "a", "b")

    def look() -> None:
        if all((run / "checkpoint").exists() for run in folders):
            assert callable(signal.getsignal(number))  # else this process would end
            os.kill(os.getpid(), number)

    at_each_look(monkeypatch, look)
    try:
        status = exit_status_of(lambda: run_trainings({run: ["trains", str(run), FOREVER] for run in folders}, 1000, 2))
        assert status == 128 + number
        if number != signal.SIGINT:
            assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)
    for run in folders:
        assert_ended_whole(run)


def test_second_ctrl_c_ends_trainings_that_do_not_listen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (run,) = runs(tmp_path, "a")
    pressed = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))

    def look() -> None:
        if (run / "pid").exists():
            pressed.start()
            raise KeyboardInterrupt

    at_each_look(monkeypatch, look)
    with pytest.raises(KeyboardInterrupt):
        run_trainings({run: ["listens_to_nobody", str(run)]}, 10, 1)
    pressed.join()
    with pytest.raises(ProcessLookupError):
        os.kill(int((run / "pid").read_text()), 0)
