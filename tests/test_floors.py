"""The architecture: imports point down, and the wheel stands alone."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT

FLOORS = ("intersection_env", "data", "agents", "imitation", "experiments")
"""From the ground up: each may import itself and what stands before it."""


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("floor", FLOORS)
def test_imports_point_down(floor: str) -> None:
    above = set(FLOORS[FLOORS.index(floor) + 1 :]) | {"tests"}
    if floor in ("agents", "imitation"):
        above.add("data")
    for path in (ROOT / floor).rglob("*.py"):
        assert not imported(path) & above, path


def test_the_twin_imports_nothing_of_the_package() -> None:
    for path in (ROOT / "tests" / "reference").glob("*.py"):
        assert imported(path).isdisjoint(FLOORS), path


def test_importing_the_package_loads_neither_pandas_nor_matplotlib_nor_torch() -> None:
    heavy = ("pandas", "matplotlib", "torch", "shapely")
    code = f"import sys, intersection_env; print([name for name in {heavy} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "[]"


def test_the_stub_is_what_the_module_says(tmp_path: Path) -> None:
    """Regenerate with `python -m nanobind.stubgen -m intersection_env._core -o intersection_env/_core.pyi`."""
    fresh = tmp_path / "_core.pyi"
    command = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "intersection_env._core", "-o", str(fresh)]
    subprocess.run(command, check=True, cwd=tmp_path)
    assert fresh.read_text() == (ROOT / "intersection_env" / "_core.pyi").read_text()


def test_kernel_override_names_what_the_machine_has() -> None:
    code = "import intersection_env; print(intersection_env._core.kernel_name())"
    for isa in ("baseline", "nonsense"):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False, env={"INTERSECTION_ENV_ISA": isa}
        )
        assert (done.stdout.strip() == "baseline") == (isa == "baseline")
        assert ('instruction set "nonsense"' in done.stderr) == (isa == "nonsense")
