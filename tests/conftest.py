"""What all tests share: the shipped maps, and random traffic for the core and its twin."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import sys
from pathlib import Path

import pytest

if folder := os.environ.get("INTERSECTION_ENV_CORE_FROM"):
    # A core built elsewhere (with sanitizers, say) in place of the installed one.
    (library,) = Path(folder).glob("_core*.so")
    loader = importlib.machinery.ExtensionFileLoader("intersection_env._core", str(library))
    spec = importlib.util.spec_from_file_location("intersection_env._core", library, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["intersection_env._core"] = module
    loader.exec_module(module)

from intersection_env import Intersection

MAP_NAMES = ("bendplatz", "t_junction", "all_way_stop", "roundabout")


@pytest.fixture(params=MAP_NAMES)
def intersection(request: pytest.FixtureRequest) -> Intersection:
    """Each shipped map in turn."""
    return Intersection.load(request.param)
