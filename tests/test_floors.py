"""The architecture: imports point down and run in no circle, and the wheel stands alone.

`FLOORS` says it as docs/architecture.md does: from the ground up, each floor may import what stands before it, and
rooms of one floor do not know each other. Imports inside functions and for types alone count too.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.support.paths import ROOT

Sources = Mapping[str, str]
"""Text by path from the project's root."""

HOUSE = ("intersection_env", "data", "agents", "imitation", "experiments", "tests")
UNKNOWN_TO = {"agents": ("data",), "imitation": ("data",)}
"""They learn from scenes, wherever these come from."""
FLOORS = {
    "intersection_env": (
        ("_core",),
        ("installed", "command", "constants", "features", "files", "arguments"),
        ("maps", "policies"),
        ("traffic",),
        ("prediction", "scenes"),
        ("evaluation", "worlds", "plots"),
        ("render",),
        ("envs",),
        ("viewer",),
        ("__init__", "map_compiler"),
        ("__main__",),
    ),
    "data": (
        ("recording", "source_text"),
        ("formats", "pipeline", "sumo"),
        ("build", "describe", "maps", "minari"),
        ("align",),
    ),
    "agents": (("networks", "training"), ("rollouts",), ("export", "gap", "idm", "orders", "ppo")),
    "imitation": (
        ("tracks", "discriminator", "cloning", "empty_road_states", "map_tables", "torch_networks"),
        ("expert", "replay_error", "torch_model", "along_route"),
        ("adjoint", "closer_look", "examples", "usable_places"),
        ("drives", "joint_moments"),
        ("gail", "rollout_gradient"),
    ),
    "experiments": (
        ("results_files", "show", "models"),
        ("report", "bench"),
        ("measure",),
        ("documentation",),
        ("reproduce",),
    ),
}
CORE = "intersection_env/core"
CORE_FLOORS = (
    ("cores",),
    ("model", "threads"),
    ("tables",),
    ("kernel/lanes",),
    ("kernel/step",),
    ("kernel/worlds",),
    ("kernel",),
    ("prediction", "worlds"),
    ("python",),
)
COMMANDS = (
    "gap",
    "crossing_order",
    "forecast",
    "horizon",
    "perception",
    "maneuver_gain",
    "driven_gain",
    "forecast",
    "closed_loop",
    "returns",
    "runtime",
    "sumo_predictor",
    "real",
    "demo",
)
"""Of experiments, beside the rooms: nobody imports them."""


def sources(*endings: str) -> dict[str, str]:
    """Every file of the house with one of these endings."""
    paths = (path for folder in HOUSE for path in sorted((ROOT / folder).rglob("*")) if path.suffix in endings)
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def python() -> dict[str, str]:
    """Every module; of the core its stub."""
    return sources(".py", ".pyi")


def module_of(path: str) -> str:
    return path.removesuffix(".py").removesuffix(".pyi").replace("/", ".").removesuffix(".__init__")


def imports(code: Sources) -> dict[str, set[str]]:
    """Of each module of the house, the modules of the house that it imports."""
    known = {module_of(path) for path in code}
    return {module_of(path): set(_imported(text, known)) for path, text in code.items()}


def _imported(text: str, known: set[str]) -> Iterator[str]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide where they point to"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            while name and name not in known:  # a name in a module, or a module
                name = name.rpartition(".")[0]
            if name:
                yield name


def room_of(module: str) -> str:
    """The room below the top folder, or the module there."""
    return [*module.split("."), "__init__"][1]


def uphill(code: Sources) -> list[str]:
    """Imports that do not point down, in words."""
    found = []
    for module, imported in imports(code).items():
        top = module.partition(".")[0]
        for other in sorted(imported - {module}):
            other_top = other.partition(".")[0]
            if top == other_top:
                wrong = top in FLOORS and _is_up(FLOORS[top], room_of(module), room_of(other))
            else:
                wrong = HOUSE.index(other_top) > HOUSE.index(top) or other_top in UNKNOWN_TO.get(top, ())
            if wrong:
                found.append(f"{module} imports {other}")
    return found


def _is_up(floors: tuple[tuple[str, ...], ...], room: str, other: str) -> bool:
    height = {name: number for number, floor in enumerate(floors) for name in floor}
    commands = {name: len(floors) for name in COMMANDS}
    height = commands | height
    assert room in height, f"{room} has no floor: give it one in FLOORS"
    assert other in height, f"{other} has no floor: give it one in FLOORS"
    return room != other and height[other] >= height[room]


def circle(graph: Mapping[str, set[str]]) -> list[str]:
    """A circle in a graph, as the way around it; empty if there is none."""
    done: set[str] = set()
    way: list[str] = []

    def visit(node: str) -> list[str]:
        if node in way:
            return [*way[way.index(node) :], node]
        if node in done:
            return []
        way.append(node)
        for other in sorted(graph.get(node, ())):
            if other != node and (found := visit(other)):
                return found
        way.pop()
        done.add(node)
        return []

    return next((found for node in sorted(graph) if (found := visit(node))), [])


def core_includes(code: Sources) -> dict[str, set[str]]:
    """Of each file of the core, by its path there, the files of the core that it includes."""
    files = {path.removeprefix(f"{CORE}/") for path in code}
    graph = {}
    for path, text in code.items():
        own = path.removeprefix(f"{CORE}/")
        named = re.findall(r'^#include "([^"]+)"', text, re.MULTILINE)
        places = [(name, f"include/{name}", str(Path(own).parent / name)) for name in named]
        found = {next((place for place in options if place in files), "") for options in places}
        assert "" not in found, f"{own} includes what is not there: {named}"
        graph[own] = found
    return graph


def core_room(path: str, implemented: Mapping[str, str]) -> str:
    """A file's room; a public header's is that of the file that implements it."""
    own = Path(path)
    if own.parts[0] == "include":
        return implemented.get(own.stem, "model")
    return own.parent.as_posix() if len(own.parts) > 1 else own.stem


def core_uphill(code: Sources) -> list[str]:
    """Includes that do not point down, in words."""
    graph = core_includes(code)
    public = {Path(path).stem for path in graph if path.startswith("include/")}
    implemented = {
        Path(path).stem: Path(path).parts[0]
        for path in graph
        if Path(path).stem in public and path.endswith(".cpp") and Path(path).parts[0] in ("model", "prediction")
    }
    found = []
    for path, included in graph.items():
        for other in sorted(included):
            rooms = core_room(path, implemented), core_room(other, implemented)
            if _is_up(CORE_FLOORS, *rooms):
                found.append(f"{path} includes {other}")
    return found


def test_imports_point_down() -> None:
    assert uphill(python()) == []


def test_imports_run_in_no_circle() -> None:
    assert circle(imports(python())) == []


def test_includes_of_the_core_point_down_and_run_in_no_circle() -> None:
    code = {path: text for path, text in sources(".cpp", ".hpp").items() if path.startswith(CORE)}
    assert core_uphill(code) == []
    assert circle(core_includes(code)) == []


@pytest.mark.parametrize(
    ("path", "line"),
    [
        ("intersection_env/maps/intersection.py", "from intersection_env.worlds import life"),
        ("intersection_env/prediction/predictor.py", "def f() -> None:\n    import intersection_env.scenes.scene"),
        ("intersection_env/traffic.py", "from intersection_env import Predictor"),
        ("intersection_env/files.py", "from data.recording import Recording"),
        ("data/recording.py", "from data.formats.ind import read_recording"),
        ("agents/ppo.py", "from data.build import build"),
        ("agents/networks/gap.py", "from agents.rollouts.envs import ReplayEnv"),
        ("imitation/expert.py", "from imitation.gail import main"),
        ("experiments/show/tables.py", "from experiments.measure.horizon import measured"),
        ("experiments/demo.py", "from tests.support.paths import ROOT"),
        ("experiments/results_files.py", "from experiments.gap import main"),
    ],
)
def test_a_planted_import_is_found(path: str, line: str) -> None:
    code = python()
    assert path in code
    found = uphill(code | {path: f"{code[path]}\n{line}\n"})
    assert len(found) == 1, found
    assert found[0].startswith(f"{module_of(path)} imports ")


def test_a_planted_circle_is_found() -> None:
    code = python()
    path = "intersection_env/worlds/recorded_tracks.py"  # in one room, where floors say nothing
    planted = code | {
        path: f"{code[path]}\ndef f() -> None:\n    from intersection_env.worlds.replay import ReplayWorlds\n"
    }
    assert uphill(planted) == []
    assert set(circle(imports(planted))) >= {
        "intersection_env.worlds.recorded_tracks",
        "intersection_env.worlds.replay",
    }


@pytest.mark.parametrize(
    ("path", "include"),
    [
        ("model/map.cpp", "kernel/kernel.hpp"),
        ("kernel/lanes/network.hpp", "kernel/step/observe.hpp"),
        ("kernel/kernel.hpp", "worlds/closed_loop.hpp"),
        ("include/intersection_env/map.hpp", "intersection_env/planner.hpp"),
        ("prediction/predictor.cpp", "worlds/replay.hpp"),
    ],
)
def test_a_planted_include_is_found(path: str, include: str) -> None:
    code = {one: text for one, text in sources(".cpp", ".hpp").items() if one.startswith(CORE)}
    planted = code | {f"{CORE}/{path}": f'{code[f"{CORE}/{path}"]}\n#include "{include}"\n'}
    found = core_uphill(planted)
    assert len(found) == 1, found
    assert found[0].startswith(f"{path} includes ")


def test_the_twin_imports_nothing_of_the_package() -> None:
    for path, text in python().items():
        if path.startswith("tests/reference/"):
            named = {name.partition(".")[0] for name in _imported(text, set(HOUSE))}
            assert named <= {"tests"}, path
            assert not re.search(r"from tests\.(?!reference)", text), path


def test_importing_the_package_loads_neither_pandas_nor_matplotlib_nor_torch() -> None:
    heavy = ("pandas", "matplotlib", "torch", "shapely", "pygame", "intersection_env.maps.compiler")
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
