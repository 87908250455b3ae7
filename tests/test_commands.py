"""What all commands hold: how they end, what their help says, and what make does."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import tyro

from agents.gap.train import PROFILES as GAP
from agents.orders.train import PROFILES as ORDERS
from agents.ppo import PROFILES as PPO
from experiments.measure import crossing_order, forecast, gap, horizon, maneuver_gain, real, validation_run
from experiments.reproduce.workspace import Options as Reproduce
from imitation.gail import PROFILES as GAIL
from imitation.rollout_gradient import PROFILES as ROLLOUT
from tests.support.paths import ROOT

FOLDERS = ("intersection_env", "data", "agents", "imitation", "experiments")
MODULES = sorted(
    path
    for folder in FOLDERS
    for path in (ROOT / folder).rglob("*.py")
    if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
)
MEASURED = (crossing_order, forecast, gap, horizon, maneuver_gain, real, validation_run)
OPTIONS = [
    Reproduce,
    *(module.Options for module in MEASURED),
    *(type(next(iter(profiles.values()))[1]) for profiles in (GAP, ORDERS, PPO, GAIL, ROLLOUT)),
]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_command_ends_by_run_command(path: Path) -> None:
    *_, last = ast.parse(path.read_text(encoding="utf-8")).body
    assert isinstance(last, ast.If)
    (call,) = last.body
    assert ast.unparse(call).startswith("run_command("), "a reader that leaves early would get a trace"


def test_a_reader_that_leaves_early_gets_no_trace() -> None:
    """As `| head -1` does, of far more than a pipe holds; the command ends as ever."""
    code = (
        "from intersection_env.command import run_command\n"
        "def main():\n"
        "    for number in range(100_000): print('a line of some length', number)\n"
        "    return 3\n"
        "run_command(main)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 3


@pytest.mark.parametrize("options", OPTIONS, ids=lambda one: f"{one.__module__}.{one.__name__}")
def test_no_help_leaves_a_default_empty(options: type, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        tyro.cli(options, args=["--help"])
    said = " ".join(re.sub("[│╭╮╰╯─]", " ", capsys.readouterr().out).split())
    assert "(default: none)" in said
    assert "(default: )" not in said


def make(*arguments: str) -> str:
    """What make says, which within another make (`make test`) begins and ends with the folder's name."""
    command = ["make", "--no-print-directory", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_make_help_names_every_target() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (phony,) = re.findall(r"^\.PHONY: (.*)$", text, re.MULTILINE)
    assert [line.split()[0] for line in make("help").splitlines()] == [
        name for name in re.findall(r"^([a-z]+):", text, re.MULTILINE) if name in phony.split()
    ]
    assert len(make("help").splitlines()) == len(phony.split())


def test_make_gap_leaves_the_policy_that_ships_alone() -> None:
    """It holds forecasts, which a network that was just trained has none of."""
    assert not re.search(r"(cp|>) .*intersection_env/policies", make("-n", "gap"))
