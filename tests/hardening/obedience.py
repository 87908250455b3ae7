"""Whether a policy keeps to the rules, on random traffic with random assigned orders.

`python -m tests.obedience --traffics 100000` (`make harden` runs it).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from intersection_env import Intersection, Predictor
from intersection_env.evaluation.obedience import Findings, look_at
from intersection_env.policies.named import DEFAULT
from tests.support.random_traffic import random_traffic
from tests.support.twins import as_traffic, random_assignment, rounded, twin_map

PAST_LINE = 0.25  # the share of vehicles that stand or creep past their line
MAPS = ("bendplatz", "t_junction", "crossroads")


def look_at_random(predictor: Predictor, seed: int, findings: Findings) -> None:
    """Predicts one random traffic with one random order, and notes what is wrong; the maps take turns."""
    generator, name = np.random.default_rng(seed), MAPS[seed % len(MAPS)]
    twin = rounded(random_traffic(twin_map(name), generator, int(generator.integers(2, 13)), PAST_LINE))
    traffic = as_traffic(Intersection.load(name), twin)
    assignment = random_assignment(traffic, generator)
    look_at(traffic, assignment[0], predictor.predict(traffic, assignment), f"{name}, seed {seed}", findings)


def main(arguments: Sequence[str] | None = None) -> int:
    """Looks at as many traffics as asked for; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.obedience", description=__doc__.splitlines()[0])
    parser.add_argument("--policy", default=DEFAULT, help="a policy")
    parser.add_argument("--traffics", type=int, default=100_000)
    options = parser.parse_args(arguments)
    predictor, findings = Predictor.load(options.policy), Findings()
    for seed in range(options.traffics):
        look_at_random(predictor, seed, findings)
    print(f"{options.policy}, {options.traffics} traffics: {findings}")
    for line in findings.wrong[:20]:
        print(f"  {line}")
    return 1 if findings.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
