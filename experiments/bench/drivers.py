"""A driver for benchmarks, as worlds full of wrecks say little: the IDM on observations, and a network fitted to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intersection_env import ClosedLoopWorlds
from intersection_env.constants import ACCELERATION, DT
from intersection_env.features import Driving

if TYPE_CHECKING:
    import torch

    Layers = Sequence[torch.nn.Linear]

Floats = NDArray[np.float32]
COMFORTABLE, BRAKING = 2.5, 4.0  # [m/s²]; paper, Section IV-C.2
STANDSTILL_GAP, TIME_GAP = 2.0, 1.5  # [m], [s], ours: the paper's 1.5 and 1 end a third more worlds
LEAST_GAP = 0.1  # [m]
HIDDEN = 16
ROUNDS, WORLDS, STEPS, KEEP = 3, 64, 240, 6  # of driving, in each of which every sixth step is kept
ADAM_STEPS, BATCH, LEARNING_RATE = 600, 2048, 1e-2
NOISE = 0.15  # of the action while samples are collected, so that mistakes are seen too


def idm_actions(observation: Floats) -> Floats:
    """The actions (...,) of an IDM that waits at its line while delta is 0 and never backs; observation (..., 12)."""
    to_line, speed, limit = (observation[..., k] for k in (Driving.DISTANCE_TO_STOP_LINE, Driving.SPEED, Driving.V_MAX))
    to_lead, lead_speed, enters = (
        observation[..., k] for k in (Driving.LEAD_DISTANCE, Driving.LEAD_SPEED, Driving.ENTERS)
    )
    acceleration = _idm(speed, limit, to_lead, lead_speed)
    waiting = np.minimum(acceleration, _idm(speed, limit, to_line, np.zeros_like(speed)))
    acceleration = np.maximum(np.where(enters > 0.5, acceleration, waiting), -speed / DT)
    return np.asarray(np.clip(acceleration / ACCELERATION, -1.0, 1.0), np.float32)


def _idm(speed: Floats, limit: Floats, gap: Floats, lead_speed: Floats) -> Floats:
    closing = speed * (speed - lead_speed) / (2.0 * np.sqrt(COMFORTABLE * BRAKING))
    wanted = STANDSTILL_GAP + np.maximum(0.0, speed * TIME_GAP + closing)
    free = 1.0 - (speed / np.maximum(limit, LEAST_GAP)) ** 4
    return np.asarray(COMFORTABLE * (free - (wanted / np.maximum(gap, LEAST_GAP)) ** 2), np.float32)


def fitted_network(seed: int = 0) -> Floats:
    """Parameters (497,), as a rollout takes them, of a 12/16/16/1 network fitted to `idm_actions` in a few seconds.

    The samples come from worlds that the IDM drives first, then the network itself, always with some noise.
    """
    import torch

    generator = np.random.default_rng(seed)
    torch.manual_seed(seed)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # for networks this small several are slower
    layers = [torch.nn.Linear(*size) for size in ((12, HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, 1))]
    seen: list[Floats] = []
    parameters = np.zeros(0, np.float32)
    for _ in range(ROUNDS):
        seen.append(_drive(parameters, generator))
        samples = np.concatenate(seen)
        shift, scale = samples.mean(axis=0), 1.0 / (samples.std(axis=0) + 0.1)
        _fit(layers, (samples - shift) * scale, idm_actions(samples), generator)
        parameters = _packed(layers, shift, scale)
    torch.set_num_threads(threads)
    return parameters


def network_output(parameters: Floats, observation: Floats) -> Floats:
    """The network's actions (...,) without noise; observation (..., 12)."""
    sizes = (HIDDEN * 12, HIDDEN, HIDDEN * HIDDEN, HIDDEN, HIDDEN, 1)
    w0, b0, w1, b1, w2, b2 = np.split(parameters, np.cumsum(sizes)[:-1])
    hidden = np.tanh(observation @ w0.reshape(HIDDEN, 12).T + b0)
    hidden = np.tanh(hidden @ w1.reshape(HIDDEN, HIDDEN).T + b1)
    return np.asarray(np.tanh(hidden @ w2 + b2), np.float32)


def _drive(parameters: Floats, generator: np.random.Generator) -> Floats:
    """Observations (sample, 12) of worlds driven by the network, or by the IDM where there is none yet."""
    worlds = ClosedLoopWorlds(worlds=WORLDS, gap="gap")
    worlds.reset(int(generator.integers(2**31)), desynchronise=True)
    kept = []
    for step in range(STEPS):
        now = worlds.observation
        if step % KEEP == 0:
            kept.append(now.reshape(-1, 12).copy())
        action = network_output(parameters, now) if len(parameters) else idm_actions(now)
        np.clip(action + generator.normal(0.0, NOISE, action.shape), -1.0, 1.0, out=worlds.action)
        worlds.step()
    return np.concatenate(kept)


def _fit(layers: Layers, inputs: Floats, actions: Floats, generator: np.random.Generator) -> None:
    import torch

    x, y = torch.from_numpy(inputs.astype(np.float32)), torch.from_numpy(actions)
    optimizer = torch.optim.Adam([p for layer in layers for p in layer.parameters()], LEARNING_RATE)
    for _ in range(ADAM_STEPS):
        batch = torch.from_numpy(generator.integers(0, len(x), BATCH))
        hidden = torch.tanh(layers[1](torch.tanh(layers[0](x[batch]))))
        loss = (torch.tanh(layers[2](hidden)).squeeze(-1) - y[batch]).square().mean()
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()


def _packed(layers: Layers, shift: Floats, scale: Floats) -> Floats:
    """Weights and biases in a row, the scaling of the inputs folded into the first layer."""
    weights = [layer.weight.detach().numpy().copy() for layer in layers]
    biases = [layer.bias.detach().numpy().copy() for layer in layers]
    weights[0] = weights[0] * scale
    biases[0] = biases[0] - weights[0] @ shift
    rows = [part.ravel() for pair in zip(weights, biases, strict=True) for part in pair]
    return np.concatenate(rows).astype(np.float32)
