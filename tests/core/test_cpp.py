"""The core as a C++ package: installed, found, and used by the example planner as documented."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Forecast, Intersection, Predictor, _core, forecast, rank_maneuvers
from tests.conftest import MAP_NAMES
from tests.hardening.planner import (
    RANDOM,
    TRAFFIC,
    assert_same,
    assert_same_forecast,
    printed,
    random_traffic,
    read_traffic,
    write_traffic,
)
from tests.support.paths import ROOT

BUILD = ROOT / "build" / "cpp"
TOOLS = Path(sys.executable).parent


def cmake(*arguments: str | Path) -> None:
    done = subprocess.run([TOOLS / "cmake", *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


def configure(source: Path, build: Path, *options: str) -> None:
    cmake("-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={TOOLS / 'ninja'}", *options)


def built_alone(program: str, folder: Path, prefix: Path) -> Path:
    """The executable of one source file, with the example's CMakeLists.txt."""
    (folder / "planner.cpp").write_text(program)
    (folder / "CMakeLists.txt").write_text((ROOT / "examples" / "planner" / "CMakeLists.txt").read_text())
    return built(folder, folder / "build", prefix)


def built(source: Path, build: Path, prefix: Path) -> Path:
    """The executable of a C++ project that finds the installed core; its path."""
    configure(source, build, f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=Release")
    cmake("--build", build)
    return build / "planner"


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the core is installed, built without Python. The build folder is kept: the next run is quick."""
    configure(ROOT / "intersection_env" / "core", BUILD, "-DINTERSECTION_ENV_PYTHON=OFF", "-DCMAKE_BUILD_TYPE=Release")
    cmake("--build", BUILD, "-j2")
    prefix = tmp_path_factory.mktemp("prefix")
    cmake("--install", BUILD, "--prefix", prefix)
    return prefix


@pytest.fixture(scope="module")
def planner(prefix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example planner, built against the installed core."""
    return built(ROOT / "examples" / "planner", tmp_path_factory.mktemp("planner"), prefix)


@pytest.fixture(scope="module")
def forecasts(prefix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that writes forecasts, built against the installed core."""
    program = (ROOT / "tests" / "hardening" / "cpp" / "forecasts.cpp").read_text()
    return built_alone(program, tmp_path_factory.mktemp("forecasts"), prefix)


def test_example_prints_the_ranking_of_python(planner: Path, prefix: Path, tmp_path: Path) -> None:
    python = rank_maneuvers(Predictor.load("gap"), read_traffic(TRAFFIC))
    cpp = printed([str(planner)], prefix, TRAFFIC)
    assert_same(cpp, python)
    assert_same_forecast(cpp, read_traffic(TRAFFIC))
    assert cpp.order.tolist() == python.order.tolist()
    assert len(cpp) > 10
    assert python.worth_executing.any(), "the example shows an intervention that pays"


@pytest.mark.parametrize("name", MAP_NAMES)
def test_example_ranks_random_traffic_as_python_does(planner: Path, prefix: Path, tmp_path: Path, name: str) -> None:
    kernel = _core.kernel_name()
    for seed in range(RANDOM):
        traffic = random_traffic(name, seed)
        write_traffic(traffic, tmp_path / "traffic.txt")
        cpp = printed(["env", f"INTERSECTION_ENV_ISA={kernel}", str(planner)], prefix, tmp_path / "traffic.txt", name)
        python = rank_maneuvers(Predictor.load("gap"), traffic)
        assert_same(cpp, python)
        assert_same_forecast(cpp, traffic)
        assert cpp.order.tolist() == python.order.tolist()


@pytest.mark.parametrize("name", MAP_NAMES)
def test_forecast_is_that_of_python_to_the_byte(forecasts: Path, prefix: Path, tmp_path: Path, name: str) -> None:
    """Without and with an order that is given, the other way round than is probable."""
    share = prefix / "share" / "intersection_env"
    predictor = Predictor.load("gail")
    several = given_ones = 0
    for seed in range(RANDOM):
        traffic = random_traffic(name, seed)
        write_traffic(traffic, tmp_path / "traffic.txt")
        free = forecast(predictor, traffic)
        for given in given_to(free):
            files = (share / "maps" / f"{name}.map", share / "policies" / "gail.policy", tmp_path / "traffic.txt")
            command = map(str, (forecasts, *files, *given.tolist()))
            environment = {**os.environ, "INTERSECTION_ENV_ISA": _core.kernel_name()}
            done = subprocess.run(list(command), capture_output=True, check=True, env=environment)
            found = forecast(predictor, traffic, given if len(given) else None)
            prediction = (found.prediction.position, found.prediction.time_loss)
            parts = (found.orders, found.probability, found.yielder_first, *prediction, found.position_quantiles())
            assert done.stdout == b"".join(np.ascontiguousarray(part).tobytes() for part in parts)
            several += len(found.orders) > 1
            given_ones += len(given) > 0
    assert several > 2
    assert given_ones > 0


def given_to(free: Forecast) -> list[NDArray[np.int8]]:
    """Nothing; and the first pair that goes both ways the less probable way round."""
    both = np.flatnonzero((free.orders != free.orders[0]).any(axis=0))
    given = np.zeros(free.orders.shape[1], np.int8)
    given[both[:1]] = -free.orders[0, both[:1]]
    return [given[:0], *([given] if len(both) else [])]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a nowhere 1 1 4 2", 'bendplatz has no route "nowhere"; its routes are '),
        ("a SE-NW 95 -1 4.5 1.8", "vehicle 0: speed must be from 0"),
        ("a SE-NW 95", "a line must be: id route position speed length width"),
    ],
)
def test_example_refuses_a_wrong_traffic_in_words(
    planner: Path, prefix: Path, tmp_path: Path, line: str, message: str
) -> None:
    (tmp_path / "traffic.txt").write_text(line)
    with pytest.raises(AssertionError, match=f"exit status 1: error: .*{re.escape(message)}"):
        printed([str(planner)], prefix, tmp_path / "traffic.txt")


@pytest.mark.parametrize("which", [0, 1])
def test_lines_of_the_documentation_compile_and_run(prefix: Path, tmp_path: Path, which: int) -> None:
    """The C++ blocks of docs/cpp.md that have a main, against the installed core alone."""
    blocks = re.findall(r"```cpp\n(.*?)```", (ROOT / "docs" / "cpp.md").read_text(), re.DOTALL)
    program = [block for block in blocks if "int main" in block][which]
    executable = built_alone(program, tmp_path, prefix)
    done = subprocess.run([executable], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[0]) >= 0.0


def test_a_planners_cycle_allocates_nothing(prefix: Path, tmp_path: Path) -> None:
    """Alone and with a second thread."""
    program = (ROOT / "tests" / "hardening" / "cpp" / "allocations.cpp").read_text()
    executable = built_alone(program, tmp_path, prefix)
    share = prefix / "share" / "intersection_env"
    files = [share / "maps" / "bendplatz.map", share / "policies" / "gap.policy"]
    for threads in ("1", "2"):
        done = subprocess.run([executable, *files, threads], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        count, scenarios = re.findall(r"\d+", done.stdout)
        assert int(scenarios) > 32
        assert int(count) == 0


def test_chained_cycles_of_a_planner_end_where_python_predicts(prefix: Path, tmp_path: Path) -> None:
    """25 predictions in C++, each from the state of the one before, beside one in Python: the same bytes."""
    program = (ROOT / "tests" / "hardening" / "cpp" / "chained.cpp").read_text()
    executable = built_alone(program, tmp_path, prefix)
    share = prefix / "share" / "intersection_env"
    files = [share / "maps" / "bendplatz.map", share / "policies" / "gap.policy"]
    kernel = {"INTERSECTION_ENV_ISA": _core.kernel_name()}
    traffic, predictor = read_traffic(TRAFFIC), Predictor.load("gap")
    best = rank_maneuvers(predictor, traffic)["priorities"].iloc[0]
    assert np.count_nonzero(best) > 3
    wholes = {
        "free": predictor.predict(traffic),
        "kept": predictor.predict(traffic, best),
        "patient": Predictor.load("gap", patience="kept").predict(traffic),
        "drawn": predictor.predict(replace(traffic, patience=predictor.patience_of(traffic, 0.8))),
    }
    for how, whole in wholes.items():
        command = [str(executable), *map(str, files), str(TRAFFIC), how]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=kernel)
        assert done.returncode == 0, done.stderr
        rows = np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()], np.float32)
        later = whole.traffic_at(5.0)
        columns = [np.asarray(getattr(later, name), np.float32) for name in ("position", "speed", "delta", "hold")]
        patience = np.zeros(len(later), np.float32) if later.patience is None else later.patience
        assert (later.patience is None) == (how in ("free", "kept"))
        np.testing.assert_array_equal(rows, np.stack([*columns, patience], axis=1))


def test_installed_headers_and_files_are_those_that_are_documented(prefix: Path) -> None:
    headers = {path.name for path in (prefix / "include" / "intersection_env").iterdir()}
    documented = set(re.findall(r"`(\w+\.hpp)`", (ROOT / "docs" / "cpp.md").read_text()))
    assert headers == documented
    for name in MAP_NAMES:
        text = (prefix / "share" / "intersection_env" / "maps" / f"{name}.map").read_text()
        assert Intersection(text, name).checksum == Intersection.load(name).checksum
