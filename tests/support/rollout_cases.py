"""Rollouts in the core, and the rule that each is what its actions give step by step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from tests.support.worlds_cases import Arrays

ROLLOUT = {
    "observation": np.float32,
    "latent": np.float32,
    "log_probability": np.float32,
    "value_now": np.float32,
    "value_next": np.float32,
    "reward": np.float32,
    "terminated": np.bool_,
    "cut": np.bool_,
}


def rolled_out(
    loop: _core.ClosedLoop | _core.Replay, policy: NDArray[np.float32], value: NDArray[np.float32], steps: int
) -> Arrays:
    """The results of a rollout with sigma 0.5, each (world, step[, vehicle][, feature])."""
    shape = (loop.action.shape[0], steps, *loop.action.shape[1:])
    arrays = {name: np.zeros((*shape, 12) if name == "observation" else shape, kind) for name, kind in ROLLOUT.items()}
    loop.rollout(policy, value, 0.5, steps, **arrays)
    return arrays


def network_parameters(generator: np.random.Generator) -> NDArray[np.float32]:
    """A driving or value network as the core takes it: of each layer weights, then biases; the scaling folded in."""
    scale = np.array([0.05, 0.1, 0.1, 1, 1, 1, 1, 1, 1, 0.03, 0.08, 1.0])
    layers = [
        generator.normal(0, 0.3, (16, 12)) * scale,
        generator.normal(0, 0.3, (16, 16)),
        generator.normal(0, 0.3, 16),
    ]
    biases = [generator.normal(0, 0.1, size) for size in (16, 16, 1)]
    parts = [part.ravel() for pair in zip(layers, biases, strict=True) for part in pair]
    return np.concatenate(parts).astype(np.float32)


def network_answers(parameters: NDArray[np.float32], features: NDArray[np.float32]) -> NDArray[np.float64]:
    """(...,): what such a network says to features (..., 12)."""
    p, x = parameters.astype(np.float64), features.astype(np.float64)
    x = np.tanh(x @ p[:192].reshape(16, 12).T + p[192:208])
    x = np.tanh(x @ p[208:464].reshape(16, 16).T + p[464:480])
    return np.asarray(x @ p[480:496] + p[496])


def check_rollouts(
    rolling: _core.ClosedLoop | _core.Replay, stepping: _core.ClosedLoop | _core.Replay, rounds: int, steps: int = 5
) -> dict[str, float]:
    """Asserts that rollouts are what stepping with their actions gives; returns how much happened, on average.

    The states are brought together before each, for the core's tanh differs from numpy's in the last digits.
    """
    generator = np.random.default_rng(0)
    policy, value = network_parameters(generator), network_parameters(generator)
    noises, met = [], []
    for _ in range(rounds):
        stepping.set_state(rolling.state())
        seen = rolled_out(rolling, policy, value, steps)
        noise = (seen["latent"] - network_answers(policy, seen["observation"])) / 0.5
        log_probability = -0.5 * noise**2 - np.log(0.5) - 0.5 * np.log(2 * np.pi)
        np.testing.assert_allclose(seen["log_probability"], log_probability, atol=1e-3)
        np.testing.assert_allclose(seen["value_now"], network_answers(value, seen["observation"]), atol=1e-4)
        for step in range(steps):
            check_step(stepping, value, {name: values[:, step] for name, values in seen.items()})
        np.testing.assert_allclose(rolling.observation, stepping.observation, atol=1e-3)
        noises.append(noise)
        met.append([seen[name].mean() for name in ("terminated", "cut")])
    drawn = np.array(noises)
    assert abs(drawn.mean()) < 4 / np.sqrt(drawn.size)
    assert abs(drawn.std() - 1) < 4 / np.sqrt(drawn.size)
    assert len(np.unique(drawn.round(6))) > 0.9 * drawn.size
    return dict(zip(("terminated", "cut"), np.mean(met, axis=0).tolist(), strict=True))


def check_step(stepping: _core.ClosedLoop | _core.Replay, value: NDArray[np.float32], seen: Arrays) -> None:
    """Asserts that one step of a rollout is that of the worlds; seen: its results (world[, vehicle][, feature])."""
    np.testing.assert_allclose(stepping.observation, seen["observation"], atol=1e-3)
    stepping.action[:] = np.tanh(seen["latent"].astype(np.float64)).astype(np.float32)
    stepping.step()
    cut = stepping.terminated | stepping.truncated
    if isinstance(stepping, _core.ClosedLoop):
        cut |= stepping.reinserted
    np.testing.assert_array_equal(stepping.terminated, seen["terminated"])
    np.testing.assert_array_equal(cut, seen["cut"])
    np.testing.assert_allclose(stepping.reward, seen["reward"], atol=0.05)
    last = np.where(cut[..., None], stepping.final_observation, stepping.observation)
    np.testing.assert_allclose(network_answers(value, last), seen["value_next"], atol=1e-3)
