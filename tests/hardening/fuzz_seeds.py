"""Writes what the fuzzers begin with: `python -m tests.hardening.fuzz_seeds FOLDER` (`make harden` runs it).

The maps that ship are too long to be mutated often; beside them goes one with few samples a route.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np

from intersection_env.maps.intersection import MAPS
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import POLICIES
from tests.support.core_and_twin import weights
from tests.support.damage import thinned
from tests.support.forecasts import forecasting
from tests.support.twins import random_networks


def write_seeds(folder: Path) -> None:
    """`map/` and `policy/`, each with short files; `shipped/` with those that ship."""
    for name in ("map", "policy", "shipped"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for file in (*MAPS.glob("*.map"), *POLICIES.glob("*.policy")):
        shutil.copy(file, folder / "shipped" / file.name)
    for file in MAPS.glob("*.map"):
        (folder / "map" / file.name).write_text(thinned(file.read_text()))
    for file in POLICIES.glob("*.policy"):
        shutil.copy(file, folder / "policy" / file.name)
    gap, driving = random_networks(np.random.default_rng(0))
    networks = PolicyFile("network", "network", weights(gap), weights(driving))
    networks.save(folder / "policy" / "networks.policy")
    forecasting(np.random.default_rng(0), networks)[0].save(folder / "policy" / "forecasts.policy")


if __name__ == "__main__":
    write_seeds(Path(sys.argv[1]))
