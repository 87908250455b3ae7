"""The scripts in `findings/` are as its page says: each listed once, with pinned packages and what it prints."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

FOLDER = ROOT / "findings"
SCRIPTS = sorted(FOLDER.glob("*.sh"))
ROW = re.compile(r"^\| \[(\w+)\]\((\w+)\.sh\) \| ([\w-]+) ([\d.]+) \| .+ \| .+ \|$", re.MULTILINE)
"""Name, file, package and version of a finding in the page's table."""
PIP = r"pip install -qq --no-compile --disable-pip-version-check((?:\\\n|[^\n])*)"
"""What a script installs, which may go on in the next line."""


def test_page_lists_every_script_once_with_the_version_that_it_installs() -> None:
    rows = ROW.findall((FOLDER / "README.md").read_text())
    assert [file for _, file, _, _ in rows] == [script.stem for script in SCRIPTS]
    for name, file, package, version in rows:
        installed = re.findall(r"([\w-]+)(?:\[\w+\])?==([\d.]+)", (FOLDER / f"{file}.sh").read_text())
        assert name == file
        assert (package, version) in installed, f"{file} does not install {package} {version}"


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_says_what_it_shows_and_pins_what_it_installs(script: Path) -> None:
    text = script.read_text()
    head, rest = text.split("set -euo pipefail\n")
    said = re.findall(r"^# (Expected|Version|Happens|Instead|Output)\b", head, flags=re.MULTILINE)
    assert said == ["Expected", "Version", "Happens", "Instead", "Output"]
    assert re.search(r"^# > .", head, flags=re.MULTILINE)
    packages = re.findall(r" '?([a-z][\w-]*(?:\[\w+\])?\S*)", re.findall(PIP, rest)[0])
    assert packages
    assert [one for one in packages if not re.fullmatch(r"[\w-]+(\[\w+\])?==[\d.]+'?", one)] == []
    assert "intersection_env" not in rest
    assert max(map(len, text.splitlines())) <= 120
    assert script.stat().st_mode & 0o111, "it cannot be run"
    subprocess.run(["bash", "-n", script], check=True)
