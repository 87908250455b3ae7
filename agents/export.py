"""The networks of a policy, for programs that have neither torch nor this checkout.

python -m agents.export rollout_gradient --network driving --to onnx --out driving.onnx
python -m agents.export runs/gap/gap.policy --network gap --to torch --out gap.pt2
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.export import Dim, ExportedProgram

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network, gap_network, order_network
from intersection_env.command import run_command
from intersection_env.features import DRIVING_FEATURES, GAP_FEATURES, ORDER_FEATURES
from intersection_env.files import check_writable, written_whole
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import DEFAULT, policy_named

COMMAND = "python -m agents.export"
SUFFIXES = {"onnx": ".onnx", "torch": ".pt2"}


class Acceleration(nn.Module):
    """What a driving network wants: features (row, 12) to accelerations (row,) [m/s²]."""

    def __init__(self, network: DrivingNetwork, scale: float) -> None:
        super().__init__()
        self.network, self.scale = network, scale

    def forward(self, features: Tensor) -> Tensor:
        """The accelerations (row,) [m/s²] of rows of features (row, 12), unscaled."""
        wanted: Tensor = self.scale * torch.tanh(self.network(features))
        return wanted


@dataclass(frozen=True)
class Exported:
    """A network of a policy file, and what goes in and comes out."""

    of: Callable[[PolicyFile], nn.Module]
    features: tuple[str, ...]
    output: str


NETWORKS = {
    "gap": Exported(gap_network, GAP_FEATURES, "logit"),
    "driving": Exported(
        lambda policy: Acceleration(driving_network(policy), policy.acceleration_scale),
        DRIVING_FEATURES,
        "acceleration",
    ),
    "orders": Exported(order_network, ORDER_FEATURES, "logit"),
}


def save_onnx(exported: Exported, policy: PolicyFile, path: Path) -> None:
    """Writes a policy's network as ONNX: "features" (row, feature) float32 to its output (row,), scaling inside.

    The file's metadata say what the features are.

    Raises:
        ValueError: the policy has no such network.
        OSError: the file cannot be written.
    """
    program = torch.onnx.export(
        exported.of(policy).eval(),
        (torch.zeros(2, len(exported.features)),),
        input_names=["features"],
        output_names=[exported.output],
        dynamic_shapes=({0: Dim("row")},),
        dynamo=True,
        verbose=False,
    )
    assert program is not None
    program.model.metadata_props["features"] = json.dumps(exported.features)
    with written_whole(path) as temporary:
        program.save(str(temporary))


def save_torch(exported: Exported, policy: PolicyFile, path: Path) -> None:
    """Writes a policy's network as an exported program of torch, likewise; `torch.export.load` reads it.

    Raises:
        ValueError: the policy has no such network.
        OSError: the file cannot be written.
    """
    example = (torch.zeros(2, len(exported.features)),)
    program: ExportedProgram = torch.export.export(
        exported.of(policy).eval(), example, dynamic_shapes=({0: Dim("row")},)
    )
    with written_whole(path) as temporary:
        try:
            torch.export.save(program, temporary, extra_files={"features.json": json.dumps(exported.features)})
        except RuntimeError as error:  # how torch says that a file cannot be written
            raise OSError(f"{path} cannot be written: {error}") from error


FORMS = {"onnx": save_onnx, "torch": save_torch}


def main(arguments: Sequence[str] | None = None) -> int:
    """Exports a network of a policy; returns the exit status."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="A network of a policy, as ONNX or for torch.")
    parser.add_argument(
        "policy", nargs="?", default=DEFAULT, help=f"a policy that ships, or a file (default: {DEFAULT})"
    )
    parser.add_argument("--network", choices=NETWORKS, required=True, help="which of its networks")
    parser.add_argument("--to", choices=FORMS, default="onnx", help="what to write (default: onnx)")
    parser.add_argument("--out", type=Path, help="the file to write (default: out/NETWORK.onnx or .pt2)")
    options = parser.parse_args(arguments)
    exported, suffix = NETWORKS[options.network], SUFFIXES[options.to]
    out = options.out or Path("out") / f"{options.network}{suffix}"
    try:
        if out.suffix != suffix:
            raise ValueError(f'--out must end in {suffix}, not "{out}"')
        check_writable(out)
        logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it tells of packages that are not needed
        policy, name = policy_named(options.policy)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # torch's own
            FORMS[options.to](exported, policy, out)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(
        f"written: {out}, the {options.network} network of {name}: {len(exported.features)} features, float32,"
        f" to {exported.output}"
    )
    return 0


if __name__ == "__main__":
    run_command(main)
