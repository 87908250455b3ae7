"""The fuzzers' sources, compiled; `make harden` builds them with clang and runs them."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

CORE = ROOT / "intersection_env" / "core"
SOURCES = sorted(Path(__file__).with_name("fuzz").glob("*.cpp"))


def test_there_is_one_for_each_reader() -> None:
    assert [source.stem for source in SOURCES] == ["map", "policy"]


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.stem)
def test_it_compiles_with_the_core_as_it_is(source: Path) -> None:
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    inside = [f"-I{CORE}", f"-I{CORE / 'include'}"]
    done = subprocess.run(
        [*compiler, "-std=c++20", "-fsyntax-only", *inside, source], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
