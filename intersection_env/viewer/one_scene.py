"""A scene in one file: the recorded traffic, and what is predicted at some of its moments, without a server."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from intersection_env.files import written_whole
from intersection_env.viewer.page_files import one_page
from intersection_env.viewer.session import Session

ORDERS = 12  # ours: orders that can be clicked; each is some 30 kB


def export(session: Session, path: Path, steps: Sequence[int] = ()) -> None:
    """Writes the page of the session's first scene.

    Args:
        session: what is open; only what it starts with is written.
        path: the file to write.
        steps: the moments at which there is a prediction; by default the one with which the session starts.

    Raises:
        OSError: the file cannot be written.
    """
    page = one_page(_shown(session, steps or (session.start["step"],)))
    with written_whole(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _shown(session: Session, steps: Sequence[int]) -> dict[str, Any]:
    """What the page would ask for, by what it asks for."""
    start = session.start
    opened = session.opened()
    place = next(one for one in opened["places"] if one["name"] == start["place"])
    place["scenes"] = [one for one in place["scenes"] if one["id"] == start["scene"]]
    shown = {"opened": opened | {"places": [place]}, "road": session.answer("road", start), "scene": None}
    if start["scene"] is not None:
        shown["scene"] = session.answer("scene", start)
    return shown | {"moments": [_moment(session, place, start, step) for step in steps]}


def _moment(session: Session, place: dict[str, Any], start: dict[str, Any], step: int) -> dict[str, Any]:
    request: dict[str, Any] = {"place": start["place"], "scene": start["scene"], "step": step}
    if start["scene"] is None:
        request = {"place": start["place"], "vehicles": place["example"]}
    ranking = session.answer("ranked", request)
    ranking["rows"] = [row for number, row in enumerate(ranking["rows"]) if number < ORDERS or _is_likely(row)]
    orders = [session.answer("predicted", request | {"priorities": row["priorities"]}) for row in ranking["rows"]]
    return {"step": step, "ranked": ranking, "predicted": session.answer("predicted", request), "orders": orders}


def _is_likely(row: dict[str, Any]) -> bool:
    return row["probability"] is not None and not row["atMost"]
