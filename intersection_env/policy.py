"""The policy file: both networks, their inputs by name, unit and scaling, and the time step they were made for."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env.files import written_whole
from intersection_env.predictor import DT

MAGIC, VERSION = "intersection_env policy", 1
GAP_FEATURES = (
    "yielder_distance_to_pga_m",
    "yielder_speed_mps",
    "foe_distance_to_stop_line_m",
    "foe_speed_mps",
)
DRIVING_FEATURES = (
    "distance_to_stop_line_m",
    "speed_mps",
    "speed_limit_mps",
    "relative_heading_-10m_rad",
    "relative_heading_-3m_rad",
    "relative_heading_3m_rad",
    "relative_heading_10m_rad",
    "relative_heading_30m_rad",
    "relative_heading_100m_rad",
    "lead_distance_m",
    "lead_speed_mps",
    "enters",
)


@dataclass(frozen=True)
class NetworkWeights:
    """A network IN/16/16/1.

    shift, scale: (input,), inputs enter as (x - shift) * scale.
    layers: (weight (output, input), bias (output,)) float32 of each layer.
    """

    shift: NDArray[np.float32]
    scale: NDArray[np.float32]
    layers: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]]


@dataclass(frozen=True)
class PolicyFile:
    """What a policy file holds. A network is there exactly where `gap` or `driver` says "network"."""

    gap: str
    driver: str
    gap_network: NetworkWeights | None = None
    driving_network: NetworkWeights | None = None
    acceleration_scale: float = 6.0
    """[m/s²] at a driving network's output of 1."""

    def text(self) -> str:
        """The file's text, checksum included; floats with nine digits, an exact float32 round trip."""
        lines = [f"{MAGIC} {VERSION}", f"dt {DT:.9g}", f"acceleration_scale {self.acceleration_scale:.9g}"]
        lines += [f"gap {self.gap}", f"driver {self.driver}"]
        if self.gap_network is not None:
            lines += _network_lines(GAP_FEATURES, self.gap_network)
        if self.driving_network is not None:
            lines += _network_lines(DRIVING_FEATURES, self.driving_network)
        body = "\n".join(lines) + "\n"
        return f"{body}checksum {zlib.crc32(body.encode()):08x}\n"

    def save(self, path: str | Path) -> None:
        """Writes the file, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        with written_whole(path) as temporary:
            temporary.write_text(self.text(), encoding="utf-8")


def _network_lines(features: Sequence[str], network: NetworkWeights) -> list[str]:
    lines = [f"inputs {len(network.shift)}"]
    lines += [f"{name} {_numbers(row)}" for name, *row in zip(features, network.shift, network.scale, strict=True)]
    for weight, bias in network.layers:
        lines.append(f"layer {weight.shape[0]} {weight.shape[1]}")
        lines.append(f"bias {_numbers(bias)}")
        lines += [_numbers(row) for row in weight]
    return lines


def _numbers(values: Iterable[np.float32]) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)
