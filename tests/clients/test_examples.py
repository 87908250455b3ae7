"""The examples that learn with other libraries: what they ask for, and that all are tried. `make clients` runs them."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
import torch

from experiments.documentation.learning import LIBRARIES
from tests.clients.__main__ import EXAMPLES, SHORTLY, dependencies, main

NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py"))


def test_every_example_is_tried_and_stands_on_the_page() -> None:
    assert sorted(SHORTLY) == NAMES
    assert sorted(LIBRARIES) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_example_says_how_to_install_what_its_header_asks_for(name: str) -> None:
    text = (EXAMPLES / f"{name}.py").read_text()
    commands = text.split("\n\n")[1]
    for one in dependencies(name):
        assert one in commands or (one == "torch" and "make setup" in commands)
    assert f"examples/learning/{name}.py" in commands


def test_single_file_example_learns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It needs no other library, so it is run here too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["single_file_ppo.py", "--iterations", "10"])
    threads = torch.get_num_threads()
    try:
        runpy.run_path(str(EXAMPLES / "single_file_ppo.py"), run_name="__main__")
    finally:
        torch.set_num_threads(threads)
    returns = [float(line.split("return")[1].split("of")[0]) for line in capsys.readouterr().out.splitlines()]
    assert len(returns) == 10
    assert sum(returns[5:]) > sum(returns[:5])


def test_unknown_example_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["nothing"])
    assert "there is no example nothing; wanted" in capsys.readouterr().err
