"""Times the predictor: microseconds a scenario, by instruction set, driver and number of scenarios.

`make bench` writes `experiments/results/bench.json`. Machines are noisy: compare within one run.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from intersection_env import Intersection, Traffic, Vehicle, _core
from intersection_env.files import written_whole
from intersection_env.policy import NetworkWeights, PolicyFile

SCENARIOS = (1, 64, 1024)
REPEATS = 15
OUT = Path(__file__).parent / "results" / "bench.json"

VEHICLES = (
    ("NW-SE", 100.0, 11.0),
    ("NW-SE", 125.0, 11.0),
    ("NW-SE", 75.0, 12.0),
    ("NW-SW", 60.0, 12.0),
    ("NW-NE", 148.0, 1.0),
    ("SE-NW", 110.0, 11.0),
    ("SE-NW", 85.0, 12.0),
    ("SE-NE", 60.0, 12.0),
    ("SE-NW", 40.0, 12.0),
    ("NE-NW", 83.0, 0.0),
    ("SE-NE", 76.0, 11.0),
    ("NE-SW", 68.0, 1.0),
    ("SW-SE", 82.0, 0.0),
    ("SW-SE", 74.0, 1.0),
    ("SW-SE", 60.0, 4.0),
)
"""(route, position [m], speed [m/s]): 15 vehicles with 25 open pairs on Bendplatz, the size the paper times."""


def traffic() -> Traffic:
    """The traffic that is timed."""
    vehicles = [Vehicle(str(k), *row) for k, row in enumerate(VEHICLES)]
    return Traffic.of(Intersection.load("bendplatz"), vehicles)


def random_network(generator: np.random.Generator, inputs: int) -> NetworkWeights:
    """A network of random weights: as slow as a trained one."""
    shapes = ((16, inputs), (16, 16), (1, 16))
    layers = [
        (generator.normal(0, 0.3, shape).astype(np.float32), generator.normal(0, 0.1, shape[0]).astype(np.float32))
        for shape in shapes
    ]
    return NetworkWeights(np.zeros(inputs, np.float32), np.full(inputs, 0.05, np.float32), layers)


def policies() -> dict[str, _core.Policy]:
    """The drivers that are timed: the rules, and two networks inside."""
    generator = np.random.default_rng(0)
    networks = PolicyFile("network", "network", random_network(generator, 4), random_network(generator, 12))
    return {
        "idm": _core.Policy(PolicyFile("critical_gap", "idm").text(), "idm"),
        "networks": _core.Policy(networks.text(), "random weights"),
    }


def microseconds(predictor: _core.Predictor, scene: Traffic, scenarios: int, isa: str, safety: bool) -> float:
    """The median time of one scenario over 10 s, summaries only [µs]."""
    assignments = np.zeros((scenarios, len(scene.conflicts)), np.int8)
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        for _ in range(max(1, 256 // scenarios)):
            predictor.predict(scene.core, assignments, False, safety, None, isa)
        times.append((time.perf_counter() - begin) / max(1, 256 // scenarios))
    return float(np.median(times)) / scenarios * 1e6


def main() -> None:
    """Times everything, prints a table and writes the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    out: Path = parser.parse_args().out
    scene = traffic()
    predict_us: dict[str, dict[str, dict[str, float]]] = {}
    print(f"{len(scene)} vehicles, {len(scene.conflicts)} open pairs, {_core.STEPS} steps; µs a scenario, one core\n")
    print(f"{'kernel':10}{'driver':12}" + "".join(f"{n:>10}" for n in SCENARIOS) + f"{'1024, with distances':>24}")
    for isa in _core.available_kernels():
        for name, policy in policies().items():
            predictor = _core.Predictor(scene.intersection.core, policy)
            row = {str(n): microseconds(predictor, scene, n, isa, False) for n in SCENARIOS}
            row["1024_with_distances"] = microseconds(predictor, scene, 1024, isa, True)
            predict_us.setdefault(isa, {})[name] = row
            print(f"{isa:10}{name:12}" + "".join(f"{row[str(n)]:10.1f}" for n in SCENARIOS), end="")
            print(f"{row['1024_with_distances']:24.1f}")
    results = {"vehicles": len(scene), "pairs": len(scene.conflicts), "steps": _core.STEPS, "predict_us": predict_us}
    with written_whole(out) as temporary:
        temporary.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    print(f"\nwrote {out}")


if __name__ == "__main__":
    main()
