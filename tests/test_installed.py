"""What a user has after installing: the package alone, its version, and a sentence where the core is missing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import intersection_env
from intersection_env import _core
from intersection_env.__main__ import main
from intersection_env.maps.intersection import shipped_maps
from intersection_env.policies.named import DEFAULT, shipped_policies
from tests.support.paths import ROOT

SITE_PACKAGES = Path(np.__file__).parents[1]


def test_an_editable_install_makes_nothing_importable_but_the_package(tmp_path: Path) -> None:
    """From another folder than the checkout, whose folders have names that others use too."""
    names = ("agents", "data", "experiments", "imitation", "tests")
    code = (
        "import importlib.util, intersection_env.prediction.forecast\n"
        f"print([name for name in {names} if importlib.util.find_spec(name)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("installed", [True, False])
def test_a_checkout_without_a_core_says_so_in_one_sentence(tmp_path: Path, installed: bool) -> None:
    """As in a checkout after `pip install .`, or before any: its folder comes first, and has no compiled core."""
    leave_out = shutil.ignore_patterns("core", "*.npz", "*.so", "__pycache__")
    shutil.copytree(ROOT / "intersection_env", tmp_path / "intersection_env", ignore=leave_out)
    elsewhere = tmp_path / "site"
    if installed:
        (elsewhere / "intersection_env").mkdir(parents=True)
        shutil.copy(str(_core.__file__), elsewhere / "intersection_env")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (elsewhere, SITE_PACKAGES)))}
    command = [sys.executable, "-S", "-c", "import intersection_env"]  # -S: no redirect to this checkout
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, env=environment)
    said = done.stderr.splitlines()[-1]
    assert done.returncode == 1
    assert f"pip install -e {tmp_path}" in said
    if installed:
        assert f"folder {tmp_path / 'intersection_env'}" in said
        assert f"hides the package installed in {elsewhere / 'intersection_env'}" in said


def test_the_package_has_the_version_that_is_installed() -> None:
    assert intersection_env.__version__ == version("intersection_env")


def test_the_command_says_version_kernels_policies_and_maps(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"intersection_env {intersection_env.__version__} ")
    for name in (*_core.available_kernels(), *shipped_policies(), *shipped_maps(), f"{DEFAULT} (default)"):
        assert name in said
