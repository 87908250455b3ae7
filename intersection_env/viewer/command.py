"""The command `python -m intersection_env view`."""

from __future__ import annotations

import argparse
import sys
import threading
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from intersection_env.files import check_writable
from intersection_env.maps.intersection import Intersection, shipped_maps
from intersection_env.policies.named import DEFAULT
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import load_places
from intersection_env.scenes.scenes import shipped_scenes
from intersection_env.viewer.one_scene import export
from intersection_env.viewer.recorded import scene_called, step_of
from intersection_env.viewer.server import Server
from intersection_env.viewer.session import Place, Session

MAP_ENDINGS = (".json", ".map")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What the command is told."""
    parser.add_argument(
        "shown",
        nargs="*",
        metavar="SCENES|MAP",
        help=f"scenes that ship ({', '.join(shipped_scenes())}) or scenes files (.npz); or maps, by name"
        f" ({', '.join(shipped_maps())}) or file (.json, .map), to put vehicles on; default: all scenes that ship",
    )
    parser.add_argument(
        "--map", nargs="+", default=[], metavar="MAP", help="maps of one's own, on which the scenes lie"
    )
    parser.add_argument("--policy", default=DEFAULT, help="a policy by name, rule or file (default: %(default)s)")
    parser.add_argument("--scene", metavar="ID", help='the scene to begin with, as "13/1" (default: the busiest)')
    parser.add_argument(
        "--moment",
        nargs="+",
        type=float,
        metavar="SECONDS",
        help="since the scene's begin: where the view begins, and at which moments an export predicts"
        " (default: the one with the most open conflicts)",
    )
    parser.add_argument("--export", type=Path, metavar="PAGE.html", help="write one file of that scene, serve nothing")
    parser.add_argument("--no-open", action="store_true", help="print the address, open no browser")
    parser.add_argument("--port", type=int, default=0, help="of this machine (default: any that is free)")


def view(options: argparse.Namespace) -> int:
    """Serves the page until Ctrl-C, or exports it; returns the exit status."""
    try:
        if options.export is not None:
            check_writable(options.export)
        session, steps = _session(options)
        if options.export is not None:
            export(session, options.export, steps)
            print(f"written: {options.export}")
            return 0
        server = Server(session, options.port)
    except (OSError, TypeError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return _serve(server, opens=not options.no_open)


def _session(options: argparse.Namespace) -> tuple[Session, list[int]]:
    """What is open, and the steps of the moments that were named."""
    places = places_of(options.shown, options.map)
    first, *_ = moments = options.moment or [None]
    session = Session(places, Predictor.load(options.policy, threads=0), options.scene, first)
    if first is None:
        return session, []
    scenes = session.places[session.start["place"]].scenes
    assert scenes is not None
    scene = scene_called(scenes, session.start["scene"])
    return session, [step_of(scene, time) for time in moments]


def places_of(shown: Sequence[str], maps: Sequence[str] = ()) -> list[Place]:
    """The places that names and files stand for: scenes first of all, or else maps without any.

    Raises:
        OSError: a file is not there, or cannot be read.
        ValueError: neither scenes nor a map, a damaged file, or the same place twice.
    """
    names = list(shown) or list(shipped_scenes())
    bare = [name for name in names if _is_map(name)]
    recorded = [name for name in names if name not in bare]
    scenes = load_places(recorded, maps) if recorded else ()
    by_name = dict(zip(recorded, (Place(one.intersection, one) for one in scenes), strict=True))
    return [by_name[name] if name in by_name else Place(Intersection.load(name)) for name in names]


def _is_map(name: str) -> bool:
    return name not in shipped_scenes() and (name in shipped_maps() or Path(name).suffix in MAP_ENDINGS)


def _serve(server: Server, opens: bool) -> int:
    with server:
        print(f"{server.address}\nCtrl-C ends it.", flush=True)
        if opens:
            threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print()
    return 0
