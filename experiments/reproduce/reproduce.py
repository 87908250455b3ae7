"""Every table and figure of the paper, from the recordings on: trains, measures, and writes the report.

python -m experiments.reproduce --recordings data/recordings
python -m experiments.reproduce --only training --ship       what ships in intersection_env/policies

What was done before with the same options is not done again, and a training that was interrupted goes on. The
validation recordings are read by the last stages alone, for the report.
"""

from __future__ import annotations

import json
import shutil
import time

import torch

from experiments.report.report import write_report
from experiments.reproduce.measurements import Measurements
from experiments.reproduce.stages import exit_status_of
from experiments.reproduce.trainings import TRAINED, Trainings
from experiments.reproduce.workspace import Options, Workspace
from intersection_env.files import written_whole
from intersection_env.policies.named import POLICIES


def reproduce(options: Options) -> None:
    """Does all stages that are not done.

    Raises:
        StageFailedError, ValueError, OSError: as of `Trainings.run`; or a results file cannot be written.
    """
    begin = time.perf_counter()
    workspace = Workspace(options)
    Trainings(workspace).run()
    if options.ship:
        ship(workspace)
    if options.only == "everything":
        Measurements(workspace).run()
        write_report(options.out)
    print(f"done in {(time.perf_counter() - begin) / 60.0:.0f} min")


def ship(workspace: Workspace) -> None:
    """Copies the policies into the package, and says there which is the default."""
    for name in TRAINED:
        shutil.copyfile(workspace.forecasting(name), POLICIES / f"{name}.policy")
    default = json.loads(workspace.default.read_text(encoding="utf-8"))["default"]
    with written_whole(POLICIES / "default") as temporary:
        temporary.write_text(f"{default}\n", encoding="utf-8")
    print(f"written: {', '.join(TRAINED)} in {POLICIES}; the default is {default}")


def main(options: Options) -> int:
    """Does all stages that are not done; returns the exit status."""
    torch.set_num_threads(1)  # such small networks gain nothing from more
    return exit_status_of(lambda: reproduce(options))
