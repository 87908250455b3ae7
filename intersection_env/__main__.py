"""The command `python -m intersection_env`: which version this is, and what it holds; `view` shows it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import intersection_env
from intersection_env import _core
from intersection_env.command import run_command
from intersection_env.maps.intersection import shipped_maps
from intersection_env.policies.named import DEFAULT, RULES, shipped_policies
from intersection_env.scenes.scenes import shipped_scenes
from intersection_env.viewer.command import add_arguments, view


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints version, kernels, policies, maps and scenes, or does what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m intersection_env", description="Which version this is, and what it holds."
    )
    parser.add_argument("--version", action="version", version=intersection_env.__version__)
    words = "traffic at an intersection in the browser: recorded, predicted, and every crossing order"
    viewing = parser.add_subparsers(metavar="view").add_parser("view", help=words, description=f"Shows {words}.")
    viewing.set_defaults(run=view)
    add_arguments(viewing)
    options = parser.parse_args(arguments)
    if "run" in options:
        return int(options.run(options))
    return _what_there_is()


def _what_there_is() -> int:
    policies = [f"{name} (default)" if name == DEFAULT else name for name in shipped_policies()]
    kernels = [f"{name} (in use)" if name == _core.kernel_name() else name for name in _core.available_kernels()]
    rows = {
        f"intersection_env {intersection_env.__version__}": str(Path(intersection_env.__file__).parent),
        "kernels (instruction sets)": ", ".join(kernels),
        "policies": ", ".join(policies),
        "rules that drive": ", ".join(RULES),
        "maps": ", ".join(shipped_maps()),
        "scenes": ", ".join(shipped_scenes()),
    }
    for what, found in rows.items():
        print(f"{what:<28}{found}")
    return 0


if __name__ == "__main__":
    run_command(main)
