"""The pictures of the viewer in docs/: `python -m experiments.documentation.viewer`. Needs Chromium."""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from experiments.documentation.browser import Browser
from intersection_env.command import run_command
from intersection_env.files import check_writable, written_whole
from intersection_env.prediction.predictor import Predictor
from intersection_env.viewer.command import places_of
from intersection_env.viewer.server import Server
from intersection_env.viewer.session import Session

PICTURES = Path("docs/pictures")
SIZE = (1280, 800)
PLACES = ("bendplatz", "roundabout")
SETTLED = "viewer.prediction && viewer.ranking && !viewer.stale && !viewer.comparing.busy"
BEST = "viewer.showOrder(viewer.ranking.rows[0]); viewer.play(false);"
LATER = "viewer.setClock(viewer.moment + 15); viewer.changed();"  # 3 s
RING = "viewer.predicts = true; viewer.prediction = null; viewer.openPlace('roundabout');"
SELECTED = "viewer.select(viewer.prediction.vehicles[0].id);"
SHOTS = {"viewer.png": (BEST, LATER), "viewer_ring.png": (RING, SELECTED)}
"""Of each picture, what the page is told: the best order of the busiest moment; a ring with a car from each arm."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the pictures and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m experiments.documentation.viewer", description=__doc__)
    parser.add_argument("--out", type=Path, default=PICTURES, help="the folder to write to (default: %(default)s)")
    options = parser.parse_args(arguments)
    try:
        check_writable(*(options.out / name for name in SHOTS))
        _draw(options.out)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _draw(folder: Path) -> None:
    session = Session(places_of(PLACES), Predictor.load())
    with Server(session) as server, Browser(*SIZE) as window:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        window.open(server.address)
        window.until(f"window.viewer && {SETTLED}")
        for name, scripts in SHOTS.items():
            for script in scripts:
                window.run(script)
                window.until(SETTLED)
            window.run("window.drawn = viewer.frames; viewer.changed()")
            window.until("viewer.frames > drawn")
            with written_whole(folder / name) as temporary:
                window.picture(temporary)
            print(f"written: {folder / name}")
        server.shutdown()


if __name__ == "__main__":
    run_command(main)
