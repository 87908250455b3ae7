"""One training run on disk: what it was told, on what data, how it went, and where it stands.

`config.json` is written first; `metrics.jsonl` grows by a line an epoch; `checkpoint.pt` is replaced whole.
A run killed at any moment resumes from its checkpoint to the same bytes as an unbroken one.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from intersection_env.files import written_whole

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

CONFIG, METRICS, CHECKPOINT = "config.json", "metrics.jsonl", "checkpoint.pt"
LAST_BYTES = 4096  # of the metrics, which hold the last line
NOT_DECISIVE = ("scenes", "map", "ppo", "run", "resume", "threads", "workers", "seeds", "tensorboard")
"""Settings that say where files lie, whose content counts by its hash, and how the work is done."""


@dataclass(frozen=True)
class RunFolder:
    """The folder of one run; make it with `begin`."""

    path: Path
    tensorboard: bool = False
    """Whether metrics go to TensorBoard's event files too; these hold an epoch twice where a run was resumed."""
    resume: bool = False
    """Whether it was asked to go on with a run that is there."""

    @classmethod
    def begin(
        cls, path: Path, settings: Mapping[str, Any], data: str, resume: bool, tensorboard: bool = False
    ) -> RunFolder:
        """Starts a run in a new folder, or goes on with the one there.

        Args:
            path: the folder.
            settings: whatever decides the result, as JSON holds it.
            data: a hash of the data.
            resume: whether to go on with a run that is there; without one, a new run starts.
            tensorboard: whether to write metrics for TensorBoard too.

        Raises:
            ValueError: the folder holds a run and `resume` is False, or that run had other settings or data; or
                TensorBoard is not there.
        """
        if tensorboard:
            try:
                import_module("tensorboard")
            except ImportError as error:
                raise ValueError(f"--tensorboard: {error}; pip install 'intersection_env[tensorboard]'") from None
        config = path / CONFIG
        wanted = {"settings": json.loads(json.dumps(settings)), "data_sha256": data}
        if config.exists():
            if not resume:
                raise ValueError(f"{path} holds a run already: choose another --run, or go on with it by --resume")
            stored = json.loads(config.read_text(encoding="utf-8"))
            _same(config, {**stored["settings"], "data": stored["data_sha256"]}, {**wanted["settings"], "data": data})
            return cls(path, tensorboard, resume)
        versions = {name: version(name) for name in ("intersection_env", "numpy", "tensordict", "torch", "torchrl")}
        with written_whole(config) as temporary:
            about = {**wanted, "versions": {"python": platform.python_version(), **versions}}
            temporary.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
        return cls(path, tensorboard, resume)

    def append(self, row: Mapping[str, Any]) -> None:
        """Adds a line to the metrics; `row` has its epoch under "epoch"."""
        with (self.path / METRICS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        if self.tensorboard:
            for name, value in _flat(row).items():
                self._events.add_scalar(name, value, int(row["epoch"]))

    @cached_property
    def _events(self) -> SummaryWriter:
        from torch.utils.tensorboard import SummaryWriter  # slow to import, and seldom wanted

        return SummaryWriter(str(self.path))

    def save(self, state: Mapping[str, Any]) -> None:
        """Replaces the checkpoint; `state` has its epoch under "epoch"."""
        with written_whole(self.path / CHECKPOINT) as temporary:
            try:
                torch.save(dict(state), temporary)
            except RuntimeError as error:  # how torch says that a file cannot be written
                raise OSError(f"{self.path / CHECKPOINT} cannot be written: {error}") from error

    def load(self) -> dict[str, Any] | None:
        """The checkpoint, None without one; metrics written after it are dropped, they will come again.

        Raises:
            ValueError: the checkpoint is damaged.
        """
        path, metrics = self.path / CHECKPOINT, self.path / METRICS
        epoch = 0
        state: dict[str, Any] | None = None
        if path.exists():
            try:
                state = torch.load(path, weights_only=True)
                epoch = int(state["epoch"])
            except Exception as error:  # torch raises whatever its unpickler does
                raise ValueError(f"{path} is damaged: {error}") from error
        if metrics.exists():
            lines = metrics.read_text(encoding="utf-8").splitlines()
            with written_whole(metrics) as temporary:
                kept = (line for line in lines if _epoch(line) <= epoch)
                temporary.write_text("".join(f"{line}\n" for line in kept), encoding="utf-8")
        return state


def decisive(settings: Any) -> dict[str, Any]:
    """Those of a trainer's settings, a dataclass, that decide the result; as JSON holds them."""
    kept: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(settings), default=str))
    return {key: value for key, value in kept.items() if key not in NOT_DECISIVE}


def last_row(metrics: Path) -> dict[str, Any]:
    """The last whole line of a metrics file, {} if there is none."""
    if not metrics.exists():
        return {}
    with metrics.open("rb") as file:
        file.seek(max(metrics.stat().st_size - LAST_BYTES, 0))
        lines = file.read().split(b"\n")
    row: dict[str, Any] = json.loads(lines[-2]) if len(lines) > 1 else {}
    return row


def file_hash(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def joint_hash(hashes: Iterable[str]) -> str:
    """One hash of several, in their order."""
    return hashlib.sha256(" ".join(hashes).encode()).hexdigest()


def state_hash(state: Any) -> str:
    """SHA-256 over every tensor and number of a checkpoint, in order."""
    digest = hashlib.sha256()
    _feed(digest, state)
    return digest.hexdigest()


def _feed(digest: hashlib._Hash, state: Any) -> None:
    if isinstance(state, torch.Tensor):
        digest.update(str(state.dtype).encode() + state.contiguous().numpy().tobytes())
    elif isinstance(state, Mapping):
        for key in state:
            digest.update(repr(key).encode())
            _feed(digest, state[key])
    elif isinstance(state, (list, tuple)):
        for one in state:
            _feed(digest, one)
    else:
        digest.update(repr(state).encode())


def _same(config: Path, stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    for key in {**stored, **wanted}:
        if stored.get(key) != wanted.get(key):
            had, has = stored.get(key), wanted.get(key)
            raise ValueError(f'{config}: the run there had "{key}" = {had!r}, not {has!r}: it cannot go on so')


def _flat(row: Mapping[str, Any], prefix: str = "") -> dict[str, float]:
    """Figures by name, those of a group within as "group/name"."""
    figures: dict[str, float] = {}
    for name, value in row.items():
        figures |= _flat(value, f"{prefix}{name}/") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
    return figures


def _epoch(line: str) -> float:
    try:
        return float(json.loads(line)["epoch"])
    except (ValueError, KeyError, TypeError):
        return float("inf")  # a line cut short by a kill
