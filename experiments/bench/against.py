"""Times this checkout against another revision of it, side by side: `make bench AGAINST=9b4ae97`.

python -m experiments.bench.against 9b4ae97 --row "replay, worlds 64"      the rows that contain these words alone

The other revision is built as a wheel, once. Each row has a pair of processes, asked in turns: what is reported is the
ratio of each pair of timings, so that a machine that slows down slows both. Networks of random weights, and vehicles,
are the same for both; maps, scenes and policy files each revision has of its own, and where the pairs that conflict
have changed since, so has the work.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.bench.drivers import fitted_network
from experiments.bench.side import DRIVERS, MEMORY, SAME
from experiments.bench.timed_traffic import VEHICLES, both_networks, random_traffics, traffic_with_orders
from intersection_env import Traffic, _core
from intersection_env.command import run_command
from intersection_env.files import check_writable, written_whole
from intersection_env.policies.file import NetworkWeights

ROOT = Path(__file__).parents[2]
BUILDS = ROOT / "build" / "against"
OUT = ROOT / "experiments" / "results" / "against.json"
HERE = Path(__file__).parent
RUN = "import sys; from side import main; main(*sys.argv[1:])"
ROUNDS = 9
ORDERS = 2000  # of the ranking
HASHED = 50  # traffics
Ask = Callable[[], Any]


def rows() -> list[str]:
    """What is asked of both sides, in the words of `side.py`."""
    found = []
    for isa in _core.available_kernels():
        for driver in DRIVERS:
            for n in (1, 64, 1024):
                found += [f"predict, driver {driver}, n {n}, isa {isa}{end}" for end in ("", ", distances yes")]
        for n in (64, 1024):
            found.append(f"predict, driver assigned, n {n}, isa {isa}, distances yes, together yes")
        found.append(f"closed loop, worlds 1024, isa {isa}")
        for worlds in (64, 1024):
            found += [f"replay, worlds {worlds}, isa {isa}", f"replay, worlds {worlds}, isa {isa}, gap recording"]
        found += [f"{SAME}, isa {isa}, of {what}" for what in ("predictions", "closed loop", "replay", "recording")]
    best = _core.available_kernels()[-1]
    found += [f"closed loop, worlds 1024, isa {best}, threads 2", f"rank, orders {ORDERS}"]
    for worlds in (64, 1024):
        found += [f"replay, worlds {worlds}, isa {best}, threads 2{end}" for end in ("", ", gap recording")]
    return [*found, f"{MEMORY}, of closed loop", f"{MEMORY}, of replay"]


def compared(row: str, sides: tuple[Path | None, Path | None], given: Path, rounds: int) -> dict[str, Any]:
    """Both sides' answers to a row, and the ratio of the second's to the first's: median, least and most.

    Args:
        row: one of `rows`.
        sides: the folders of the packages; None: the one that is installed.
        given: what `write_given` wrote.
        rounds: pairs of timings.

    Raises:
        RuntimeError: a side fails; its message says how.
    """
    with ExitStack() as open_sides:
        then, now = (open_sides.enter_context(_side(side, given, row)) for side in sides)
        if row.startswith(SAME):
            return {"row": row, "equal": then() == now()}
        once = row.startswith(MEMORY)
        pairs = np.array([(then(), now()) for _ in range(1 if once else rounds)], np.float64)
    ratio = pairs[:, 1] / pairs[:, 0]
    found = {"then": float(np.median(pairs[:, 0])), "now": float(np.median(pairs[:, 1]))}
    return {"row": row, **found, "ratio": float(np.median(ratio)), "least": ratio.min(), "most": ratio.max()}


@contextmanager
def _side(package: Path | None, given: Path, row: str) -> Iterator[Ask]:
    """A process that times this row, ready to be asked."""
    options, folders = ["-W", "ignore"], [str(HERE)]
    if package is not None:
        options.append("-S")  # no site, by which an editable install would come first
        folders += [str(package), sysconfig.get_path("purelib")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(folders)}
    with subprocess.Popen(
        [sys.executable, *options, "-c", RUN, str(given), row],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=given.parent,
        env=environment,
    ) as side:
        assert side.stdin is not None
        assert side.stdout is not None
        asked, answers = side.stdin, side.stdout

        def answer() -> Any:
            line = answers.readline()
            if not line:
                raise RuntimeError(f"{row}: a side ended with exit status {side.wait()}; what it said stands above")
            return json.loads(line)

        def ask() -> Any:
            asked.write("\n")
            asked.flush()
            return answer()

        answer()  # its greeting
        yield ask
        asked.close()


def built(revision: str) -> Path:
    """The folder of a revision's package, built with the tools of this one if it was not before.

    Raises:
        ValueError: no such revision, or it cannot be built.
    """
    said = subprocess.run(
        ["git", "rev-parse", "--verify", f"{revision}^{{commit}}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if said.returncode:
        raise ValueError(f'"{revision}" is no revision of this repository')
    commit = said.stdout.strip()
    out = BUILDS / commit
    if out.exists():
        return out
    print(f"building {commit[:7]}", flush=True)
    BUILDS.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=BUILDS) as folder:
        tree, package = Path(folder) / "tree", Path(folder) / "package"
        tree.mkdir()
        archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
        subprocess.run(["tar", "-x"], cwd=tree, input=archive, check=True)
        install = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
        done = subprocess.run(
            [*install, "--no-build-isolation", "--target", str(package), str(tree)],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise ValueError(f"{commit[:7]} cannot be built:\n{done.stderr[-2000:]}")
        package.rename(out)
    return out


def write_given(path: Path) -> None:
    """What both sides are given: vehicles, and networks of random weights; as `side.read` reads it."""
    policy = both_networks()
    assert policy.gap_network is not None
    assert policy.driving_network is not None
    drawn = islice(random_traffics(), HASHED)
    vehicles = {"vehicles": VEHICLES, f"vehicles_{ORDERS}": _vehicles(traffic_with_orders(ORDERS)[0])}
    driver = fitted_network()
    value = (0.1 * np.random.default_rng(0).normal(size=driver.shape)).astype(np.float32)
    arrays = {"policy": driver, "value": value} | _layers("gap", policy.gap_network)
    arrays |= _layers("driving", policy.driving_network)
    text = json.dumps({**vehicles, "random": [_vehicles(one) for one in drawn]})
    np.savez(path, vehicles=np.array(text), **arrays)  # type: ignore[arg-type]


def _layers(name: str, network: NetworkWeights) -> dict[str, NDArray[np.float32]]:
    parts = [network.shift, network.scale, *(part for layer in network.layers for part in layer)]
    return {f"{name}/{place:02}": part for place, part in enumerate(parts)}


def _vehicles(scene: Traffic) -> list[tuple[str, float, float]]:
    columns = zip(scene.route.tolist(), scene.position.tolist(), scene.speed.tolist(), strict=True)
    return [(scene.intersection.routes[route].id, position, speed) for route, position, speed in columns]


def main(arguments: Sequence[str] | None = None) -> int:
    """Times the rows, prints a table, writes the results; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bench.against", description=__doc__)
    parser.add_argument("revision", help="a commit of this repository")
    parser.add_argument("--row", default="", help="the rows alone that contain this")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="pairs of timings of each row")
    parser.add_argument("--out", type=Path, help="the results file to write; by default the report's, of all rows")
    options = parser.parse_args(arguments)
    chosen = [row for row in rows() if options.row in row]
    out = options.out or (OUT if len(chosen) == len(rows()) else None)
    try:
        if not chosen:
            raise ValueError(f'no row contains "{options.row}"; there are:\n' + "\n".join(rows()))
        if options.rounds < 1:
            raise ValueError(f"--rounds is {options.rounds}; wanted at least 1")
        if out is not None:
            check_writable(out)
        package = built(options.revision)
        found = []
        with tempfile.TemporaryDirectory() as folder:
            given = Path(folder) / "given.npz"
            write_given(given)
            print(f"{'now beside ' + package.name[:7]:56}{'median':>8}{'least':>8}{'most':>8}")
            for row in chosen:
                found.append(compared(row, (package, None), given, options.rounds))
                print(_in_words(found[-1]), flush=True)
        if out is not None:
            with written_whole(out) as temporary:
                temporary.write_text(json.dumps({"revision": package.name, "rows": found}, indent=1) + "\n")
            print(f"\nwritten: {out}")
    except (OSError, RuntimeError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _in_words(found: dict[str, Any]) -> str:
    if "equal" in found:
        return f"{found['row']:56}{'equal' if found['equal'] else 'differ':>8}"
    return f"{found['row']:56}" + "".join(f"{found[name]:8.2f}" for name in ("ratio", "least", "most"))


if __name__ == "__main__":
    run_command(main)
