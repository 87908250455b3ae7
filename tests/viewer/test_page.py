"""The files of the page, and the page that needs no server."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import Any

import pytest

from intersection_env import Intersection, Predictor, Scenes
from intersection_env.constants import DT
from intersection_env.viewer.one_scene import export
from intersection_env.viewer.page_files import IMPORT, joined, one_page, page_files
from intersection_env.viewer.session import Place, Session

SCRIPTS = {name: text.decode() for name, text in page_files().items() if name.endswith(".js")}


@pytest.fixture(scope="module")
def session() -> Session:
    scenes = Scenes.load("t_junction").select("development")
    return Session([Place(scenes.intersection, scenes)], Predictor.load())


def data_in(page: str) -> dict[str, Any]:
    (text,) = re.findall(r'<script type="application/json" id="shown">(.*?)</script>', page)
    found: dict[str, Any] = json.loads(text)
    return found


def test_no_file_of_the_page_names_another_place() -> None:
    for name, text in page_files().items():
        assert b"://" not in text, name
        assert b"innerHTML" not in text, f"{name}: what comes from a file would become part of the page"
        assert b"eval(" not in text, name


def test_all_modules_come_into_one_script_each_behind_what_it_imports() -> None:
    script = joined(SCRIPTS)
    order = re.findall(r"^// (\w+\.js)$", script, re.MULTILINE)
    assert sorted(order) == sorted(SCRIPTS)
    for name, text in SCRIPTS.items():
        assert all(order.index(f"{other}.js") < order.index(name) for other in IMPORT.findall(text))
    assert not re.search(r"^(import|export) ", script, re.MULTILINE)


def test_names_at_the_top_of_the_modules_differ() -> None:
    names = re.findall(r"^(?:async )?(?:function|class|const|let) (\w+)", joined(SCRIPTS), re.MULTILINE)
    assert len(names) > 50
    assert [name for name in names if names.count(name) > 1] == []


def test_every_element_that_a_script_looks_for_is_in_the_page() -> None:
    ids = re.findall(r'id="([\w-]+)"', page_files()["index.html"].decode())
    assert len(ids) == len(set(ids))
    asked = re.findall(r'(?:getElementById|\bat|\bon|\bpress)\("([\w-]+)"', "".join(SCRIPTS.values()))
    assert set(asked) - set(ids) == {"shown"}  # of exported pages


def test_the_one_page_lets_in_nothing_but_what_it_holds() -> None:
    page = one_page({"a": "</script><b>"})
    policy = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]+)"', page)[0]
    assert policy.startswith("default-src 'none';")
    for tag, kind in (("style", "style-src"), ('script type="module"', "script-src")):
        (content,) = re.findall(rf"<{tag}>(.*?)</{tag.split()[0]}>", page, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert f"{kind} 'sha256-{digest}'" in policy
    assert "</script><b>" not in page
    assert data_in(page) == {"a": "</script><b>"}
    assert not re.search(r'(src|href)="(?!data:)', page)


def test_an_export_holds_the_scene_its_moments_and_their_orders(session: Session, tmp_path: Path) -> None:
    steps = [session.start["step"], 0]
    export(session, tmp_path / "page.html", steps)
    found = data_in((tmp_path / "page.html").read_text())
    assert found["scene"] == session.answer("scene", session.start)
    assert [place["scenes"] for place in found["opened"]["places"]] != [[]]
    assert [moment["step"] for moment in found["moments"]] == steps
    request = session.start | {"step": steps[0]}
    first = found["moments"][0]
    assert first["predicted"] == session.answer("predicted", request)
    assert len(first["orders"]) == len(first["ranked"]["rows"]) > 0
    for row, shown in zip(first["ranked"]["rows"], first["orders"], strict=True):
        assert shown == session.answer("predicted", request | {"priorities": row["priorities"]})


def test_an_export_of_a_place_without_scenes_holds_its_example(tmp_path: Path) -> None:
    session = Session([Place(Intersection.load("roundabout"))], Predictor.load())
    export(session, tmp_path / "page.html")
    found = data_in((tmp_path / "page.html").read_text())
    assert found["scene"] is None
    example = found["opened"]["places"][0]["example"]
    assert [one["id"] for one in found["moments"][0]["predicted"]["vehicles"]] == [one["id"] for one in example]


def test_recorded_motion_in_the_page_is_the_scenes_to_a_centimetre(session: Session) -> None:
    scenes = session.places["t_junction"].scenes
    assert scenes is not None
    answer = session.answer("scene", session.start)
    step = session.start["step"]
    shown = {
        track["id"]: track["position"][step - track["start"]]
        for track in answer["tracks"]
        if track["start"] <= step < track["start"] + len(track["position"])
    }
    traffic = scenes.at(answer["id"], step * DT)
    assert tuple(shown) == traffic.ids
    assert list(shown.values()) == pytest.approx(traffic.position.tolist(), abs=0.006)
