"""Times the predictor (microseconds a scenario), the environments, training and, beside them, others' work.

`make bench` writes `experiments/results/bench.json`. Machines are noisy: compare within one run.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.bench.environments import environment_rates
from experiments.bench.forecast import forecast_times
from experiments.bench.predictor import predictor_times
from experiments.bench.training import training_rates
from intersection_env.files import check_writable, written_whole

PARTS = ("predictor", "forecast", "environments", "training")
OUT = Path(__file__).parents[1] / "results" / "bench.json"


def main(arguments: Sequence[str] | None = None) -> int:
    """Times everything, or one part beside what the file has of the others; prints tables and writes the results.

    Returns the exit status.
    """
    parser = argparse.ArgumentParser(prog="python -m experiments.bench", description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="the results file to write")
    parser.add_argument("--part", choices=("all", *PARTS), default="all", help="time this alone; keep the others")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions of the predictor's")
    options = parser.parse_args(arguments)
    try:
        check_writable(options.out)
        results: dict[str, Any] = {}
        if options.part != "all" and options.out.exists():
            results = json.loads(options.out.read_text(encoding="utf-8"))
        if options.part in ("all", "predictor"):
            others = {part: results[part] for part in PARTS[1:] if part in results}
            results = predictor_times(options.quick) | others
        if options.part in ("all", "forecast"):
            results["forecast"] = forecast_times(options.quick)
        if options.part in ("all", "environments"):
            results["environments"] = environment_rates()
        if options.part in ("all", "training"):
            results["training"] = training_rates()
        with written_whole(options.out) as temporary:
            temporary.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"\nwritten: {options.out}")
    return 0
