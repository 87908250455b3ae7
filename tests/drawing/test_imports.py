"""What drawing loads, and that the files of a room stand on each other in one order."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import PACKAGE

ROOMS = {
    "maps": "name curve source_values source_entries source meeting route shared right_of_way conflicts compiler "
    "intersection limits outline __main__",
    "plots": "files colours lanes map_labels map_plot prediction_plot forecast_plot animation __main__",
    "render": "snapshot camera ink road_layer traffic_layer renderer of_worlds",
    "envs": "actions spaces view central_state spec closed_loop replay replay_vector variants",
}
"""From the ground up: each file may import, early or late, those that stand before it."""
NO_PICTURE = ("matplotlib", "pandas", "torch", "intersection_env.plots")
NO_MAP_SOURCE = ("intersection_env.maps.compiler", "intersection_env.maps.source")


def imported(path: Path) -> set[str]:
    """The files of the package that a file imports anywhere, as "maps.outline"."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name.removeprefix("intersection_env.") for name in names}


@pytest.mark.parametrize("room", ROOMS)
def test_files_of_a_room_import_only_those_before_them(room: str) -> None:
    files = ROOMS[room].split()
    assert sorted(path.stem for path in (PACKAGE / room).glob("*.py")) == sorted([*files, "__init__"])
    for place, file in enumerate(files):
        after = {f"{room}.{other}" for other in files[place:]}
        assert not imported(PACKAGE / room / f"{file}.py") & after, file


def loaded(code: str, *names: str) -> set[str]:
    """Which of these modules are there after some code ran in a fresh process, which may print nothing else."""
    code = f"{code}\nimport sys\nprint(*[name for name in {names} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return set(done.stdout.strip().split(" ")) - {""}


def test_importing_the_package_loads_nothing_to_draw_with_and_nothing_to_compile_maps() -> None:
    drawing = ("shapely", "pygame", "intersection_env.render", *NO_PICTURE)
    assert loaded("import intersection_env", *drawing, *NO_MAP_SOURCE) == set()
    code = "from intersection_env import Intersection\nIntersection.load('bendplatz').conflicts"
    assert loaded(code, *drawing, *NO_MAP_SOURCE) == set()


def test_outline_of_a_road_loads_shapely_with_the_first_area() -> None:
    code = (
        "from intersection_env import Intersection\nfrom intersection_env.maps import outline\n"
        "map = Intersection.load('bendplatz')\noutline.junction_extent(map), list(outline.stop_lines(map, 2.0))"
    )
    assert loaded(code, "shapely", *NO_MAP_SOURCE) == set()
    assert loaded(f"{code}\noutline.pavement(route.samples for route in map.routes)", "shapely") == {"shapely"}


def test_pygame_is_loaded_by_a_renderer_alone_and_without_a_greeting() -> None:
    code = "from intersection_env import Intersection\nfrom intersection_env.render.renderer import Renderer"
    assert loaded(code, "pygame", "shapely") == set()
    assert loaded(f"{code}\nRenderer(Intersection.load('t_junction'), (64, 64))", "pygame") == {"pygame"}


@pytest.mark.parametrize(
    "made",
    [
        "intersection_env.Replay(render_mode='rgb_array')",
        "intersection_env.ReplayVector(render_mode='rgb_array')",
        "intersection_env.ClosedLoop(render_mode='rgb_array')",
    ],
)
def test_frame_loads_neither_plots_nor_what_compiles_maps(made: str) -> None:
    code = f"import intersection_env\nworld = {made}\nworld.reset(seed=1)\nassert world.render() is not None"
    assert loaded(code, "pygame", *NO_PICTURE, *NO_MAP_SOURCE) == {"pygame"}


def test_plot_of_a_compiled_map_needs_neither_its_compiler_nor_pygame() -> None:
    code = (
        "from intersection_env import Intersection\nfrom intersection_env.plots.map_plot import plot_map\n"
        "plot_map(Intersection.load('t_junction'))"
    )
    assert loaded(code, "matplotlib", "pygame", "torch", *NO_MAP_SOURCE) == {"matplotlib"}
