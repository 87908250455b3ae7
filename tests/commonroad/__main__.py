"""Holds the reader of CommonRoad's protobuf to the library that writes it: `make commonroad`.

Each version of commonroad-io that has another layout, in an environment of its own in out/commonroad (it asks for a
protobuf older than ours), writes a small scenario of ours; read here, it is what our XML reader reads of the same.

python -m tests.commonroad           checks
python -m tests.commonroad --keep    and keeps the files for tests/data (tests/data/commonroad)
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.formats.commonroad import read_commonroad
from tests.support.commonroad_scenario import assert_same_map, assert_same_recording, write_made_scenario
from tests.support.paths import ROOT

VERSIONS = ("2022.2", "2024.3", "2026.1")
"""The first and the last that write one file, and the one that writes three."""
KEPT = {"2024.3": ("scenario.pb",), "2026.1": ("map.pb", "dynamic.pb", "problems.pb")}
FILES = ROOT / "tests" / "data" / "commonroad"
ENVIRONMENTS = ROOT / "out" / "commonroad"


def written(version: str, source: Path) -> tuple[Path, str]:
    """The folder into which a version wrote a scenario, and what it printed last.

    Raises:
        CalledProcessError: pip or the version failed; what they said is on the screen.
    """
    home = ENVIRONMENTS / version
    python, folder = home / "bin" / "python", home / "written"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", home], check=True)
        pip = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
        subprocess.run([*pip, f"commonroad-io=={version}"], check=True)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    script = Path(__file__).with_name("write.py")
    done = subprocess.run([python, script, source, folder], check=True, stdout=subprocess.PIPE, text=True)
    return folder, (done.stdout.splitlines() or [""])[-1]


def check(version: str, source: Path) -> Path:
    """Compares what is read of one version's files with what is read of XML; returns the folder of the files.

    Raises:
        AssertionError: they differ.
    """
    folder, printed = written(version, source)
    one = (folder / "scenario.pb").exists()
    assert_same_map(source, folder / ("scenario.pb" if one else "map.pb"))
    assert_same_recording(source, folder / ("scenario.pb" if one else "dynamic.pb"))
    if not one:  # XML has no such shape: the library itself says where the middle is
        truck = read_commonroad([folder / "truck.pb"])
        middle = [float(number) for number in printed.split()]
        np.testing.assert_allclose([truck.x[0], truck.y[0]], middle, atol=1e-9)
    return folder


def main(arguments: Sequence[str] | None = None) -> int:
    """Checks all versions; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.commonroad", description=main.__doc__)
    parser.add_argument("--keep", action="store_true", help="replaces the files of tests/data/commonroad")
    keep = parser.parse_args(arguments).keep
    ENVIRONMENTS.mkdir(parents=True, exist_ok=True)
    source = ENVIRONMENTS / "made.xml"
    write_made_scenario(source)
    for version in VERSIONS:
        folder = check(version, source)
        print(f"commonroad-io {version}: {', '.join(sorted(path.name for path in folder.iterdir()))}: as the XML")
        for name in KEPT.get(version, ()) if keep else ():
            shutil.copy(folder / name, FILES / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
