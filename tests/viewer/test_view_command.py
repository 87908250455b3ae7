"""The command `python -m intersection_env view`: what it opens, how it ends, and what it refuses."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from intersection_env import Intersection
from intersection_env.__main__ import main
from intersection_env.maps.intersection import MAPS
from intersection_env.scenes.scenes import RECORDED
from intersection_env.viewer.command import places_of
from tests.support.own_place import own_scenes


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Commands started within it take Ctrl-C, also where this process was told to ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_it_serves_until_it_is_interrupted_and_then_ends_cleanly() -> None:
    command = [sys.executable, "-m", "intersection_env", "view", "roundabout", "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32,}/", address)
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(address, timeout=60) as answer:
            assert b"<title>intersection_env: viewer</title>" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        said, error = process.stdout.read(), process.stderr.read()
    assert (process.returncode, said.strip(), error) == (0, "Ctrl-C ends it.", "")


def test_names_and_files_open_places() -> None:
    assert [place.intersection.name for place in places_of([])] == ["bendplatz", "crossroads", "t_junction"]
    assert all(place.scenes is not None for place in places_of([]))
    named = places_of(["roundabout", "bendplatz", str(MAPS / "all_way_stop.json"), str(RECORDED / "t_junction.npz")])
    assert [place.intersection.name for place in named] == ["roundabout", "bendplatz", "all_way_stop", "t_junction"]
    assert [place.scenes is None for place in named] == [True, False, True, False]
    assert named[0].intersection == Intersection.load("roundabout")


WRONG = {
    "unknown": (["nowhere"], '"nowhere": no scenes file at this path'),
    "no map": (["nowhere.map"], 'map "nowhere.map": no such file'),
    "twice": (["bendplatz", "bendplatz"], '"bendplatz": the same scenes twice'),
    "policy": (["--policy", "nobody"], "nobody"),
    "scene": (["--scene", "99/9"], 'no scene "99/9"'),
    "moment": (["--moment", "0.3"], "the moment is 0.3 s"),
    "later moment": (["--moment", "0", "1e9"], "the moment is 1e+09 s"),
    "moment of a map": (["roundabout", "--moment", "0"], "nothing is recorded on these maps"),
    "port": (["roundabout", "--port", "70000"], "ports are from 0 to 65535"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_in_one_sentence(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, words = WRONG[name]
    assert main(["view", "--no-open", *arguments]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert words in said.err
    assert said.err.count("\n") == 1


def test_a_port_that_is_taken_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["view", "roundabout", "--no-open", "--port", str(port)]) == 1
    assert capsys.readouterr().err == f"error: port {port} of 127.0.0.1: Address already in use\n"


def test_an_export_needs_no_server(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "page.html"
    assert main(["view", "t_junction", "--moment", "10", "12.4", "--export", str(out)]) == 0
    assert capsys.readouterr().out == f"written: {out}\n"
    assert '"moments":[{"step":50,' in out.read_text()
    assert '{"step":62,' in out.read_text()


def test_scenes_on_a_map_of_ones_own_open_with_it(tmp_path: Path) -> None:
    scenes, map = own_scenes(tmp_path)
    (opened,) = places_of([str(scenes)], [str(map)])
    assert opened.scenes is not None
    assert opened.intersection == Intersection.load(map)
