"""The policy file: both networks, their inputs by name, unit and scaling, and the time step they were made for."""

from __future__ import annotations

import dataclasses
import json
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import DT
from intersection_env.features import DRIVING_FEATURES, GAP_FEATURES, ORDER_FEATURES
from intersection_env.files import written_whole

MAGIC = "intersection_env policy"
PLAIN, FORECASTS = 1, 2  # versions: without an order network and a spread, and with them


@dataclass(frozen=True, eq=False)
class NetworkWeights:
    """A network IN/16/16/1, or IN/32/32/1 of orders.

    shift, scale: (input,), inputs enter as (x - shift) * scale.
    layers: (weight (output, input), bias (output,)) float32 of each layer.
    """

    shift: NDArray[np.float32]
    scale: NDArray[np.float32]
    layers: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]]


@dataclass(frozen=True)
class IdmParameters:
    """The Intelligent Driver Model's; defaults: paper, Section IV-C.2, and ours where it has none."""

    standing_gap: float = 1.5
    """[m]"""
    time_gap: float = 1.0
    """[s]"""
    acceleration: float = 2.5
    """[m/s²]"""
    deceleration: float = 4.0
    """Comfortable [m/s²]; also into curves."""
    deceleration_limit: float = 8.0
    """Hardest [m/s²]; ours."""
    speed_share: float = 1.0
    """Speed with nobody ahead, as a share of the limit."""
    lateral_acceleration: float = 1000.0
    """In curves, at most [m/s²]; 1000: curves slow nobody."""


@dataclass(frozen=True, eq=False)
class Spread:
    """How far drivers are from where they are predicted to be under the order that came true.

    scale: (10, 5) float32 [m], at 1, 2, ..., 10 s, where the predicted way until then is 0, 5, 15, 40 and 80 m.
    shape: (10, 19) float32, quantiles at levels 0.05, 0.1, ..., 0.95, in units of the scale; they do not fall.
    """

    scale: NDArray[np.float32]
    shape: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PolicyFile:
    """What a policy file holds. A network is there exactly where `gap` or `driver` says "network".

    `order_network` and `spread` are what forecasts need: both are there, or neither.
    """

    gap: str
    driver: str
    gap_network: NetworkWeights | None = None
    driving_network: NetworkWeights | None = None
    acceleration_scale: float = 6.0
    """[m/s²] at a driving network's output of 1."""
    idm: IdmParameters = IdmParameters()
    """Where `driver` is "idm"."""
    about: Mapping[str, Any] = field(default_factory=dict)
    """Provenance and scores, as JSON holds them."""
    order_network: NetworkWeights | None = None
    """Its output is the logit of a pair's yielder going first."""
    spread: Spread | None = None

    def __post_init__(self) -> None:
        if (self.order_network is None) != (self.spread is None):
            raise ValueError("a policy holds an order network and a spread, or neither")

    @classmethod
    def read(cls, path: str | Path) -> PolicyFile:
        """The file at `path`.

        Raises:
            ValueError: it is damaged, or made for something else; the message says what.
            OSError: it cannot be read.
        """
        try:
            return cls.parse(Path(path).read_text(encoding="utf-8"), str(path))
        except UnicodeDecodeError as error:
            raise ValueError(f"{path}: is not text: {error}") from None

    @classmethod
    def parse(cls, text: str, where: str) -> PolicyFile:
        """The content of a policy file's text, named `where` in errors; raises as `read` does."""
        about = _core.Policy(text, where).about  # the core is the judge; what it lets pass is well-formed
        lines = iter(text.splitlines()[2:])
        value = {key: next(lines).split(" ")[1] for key in ("dt", "acceleration_scale", "gap", "driver")}
        idm = IdmParameters()
        if value["driver"] == "idm":
            idm = IdmParameters(*map(float, next(lines).split(" ")[1:]))
        gap = _network_from(lines, len(GAP_FEATURES)) if value["gap"] == "network" else None
        driving = _network_from(lines, len(DRIVING_FEATURES)) if value["driver"] == "network" else None
        scale = float(value["acceleration_scale"])
        order, spread = None, None
        if text.startswith(f"{MAGIC} {FORECASTS}\n"):
            order, spread = _network_from(lines, len(ORDER_FEATURES)), _spread_from(lines)
        return cls(value["gap"], value["driver"], gap, driving, scale, idm, json.loads(about), order, spread)

    def text(self) -> str:
        """The file's text, checksum included; floats with nine digits, an exact float32 round trip."""
        version = PLAIN if self.order_network is None else FORECASTS
        lines = [f"{MAGIC} {version}", f"about {json.dumps(self.about, sort_keys=True)}"]
        lines += [f"dt {DT:.9g}", f"acceleration_scale {self.acceleration_scale:.9g}"]
        lines += [f"gap {self.gap}", f"driver {self.driver}"]
        if self.driver == "idm":
            lines.append("idm " + _numbers(dataclasses.astuple(self.idm)))
        if self.gap_network is not None:
            lines += _network_lines(GAP_FEATURES, self.gap_network)
        if self.driving_network is not None:
            lines += _network_lines(DRIVING_FEATURES, self.driving_network)
        if self.order_network is not None and self.spread is not None:
            lines += _network_lines(ORDER_FEATURES, self.order_network)
            for scale, shape in zip(self.spread.scale, self.spread.shape, strict=True):
                lines += [f"spread_scale {_numbers(scale)}", f"spread_shape {_numbers(shape)}"]
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


def _spread_from(lines: Iterator[str]) -> Spread:
    rows = [next(lines).split(" ")[1:] for _ in range(2 * _core.SPREAD_SECONDS)]
    return Spread(np.array(rows[::2], dtype=np.float32), np.array(rows[1::2], dtype=np.float32))


def _network_from(lines: Iterator[str], inputs: int) -> NetworkWeights:
    def numbers(line: str, skip: int = 0) -> NDArray[np.float32]:
        return np.array(line.split(" ")[skip:], dtype=np.float32)

    next(lines)  # inputs
    scaling = np.stack([numbers(next(lines), 1) for _ in range(inputs)])
    layers = []
    for _ in range(3):
        outputs = int(next(lines).split(" ")[1])
        bias = numbers(next(lines), 1)
        layers.append((np.stack([numbers(next(lines)) for _ in range(outputs)]), bias))
    return NetworkWeights(scaling[:, 0].copy(), scaling[:, 1].copy(), layers)


def _numbers(values: Iterable[np.float32]) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)
