"""The core's predictor beside its twin: the same networks, and what they must agree in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from intersection_env import Traffic, _core
from intersection_env.policies.file import NetworkWeights, PolicyFile
from tests.reference import predictor as reference
from tests.support.twins import twin_of

TRAJECTORY_TOLERANCE = 1e-3  # [m] after 10 s, with decisions replayed
SPEED_TOLERANCE, ACCELERATION_TOLERANCE = 2e-3, 2e-2  # [m/s, m/s²]
CREEPING, SCATTER = 0.3, 5.0
"""Below that speed [m/s] so many times more, where it is allowed: a network held 1 m behind its lead makes up in a step
for what a distance is off (1 mm in 0.2 s are 5 mm/s), and overdoes it, while positions stay together."""


def weights(network: reference.Network) -> NetworkWeights:
    """The twin's network as a policy file has it."""
    layers = [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in network.layers]
    return NetworkWeights(network.shift.astype(np.float32), network.scale.astype(np.float32), layers)


def core_predictor(traffic: Traffic, policy: PolicyFile) -> _core.Predictor:
    """The core's own predictor, which takes decisions to replay."""
    return _core.Predictor(traffic.intersection.core, _core.Policy(policy.text(), "test"))


def replayed(
    traffic: Traffic,
    twin: reference.Traffic,
    predictor: _core.Predictor,
    assignment: NDArray[np.int8],
    may_creep: bool = False,
    /,
    **how: object,
) -> float:
    """Asserts that core and twin agree, decisions replayed from the twin; returns how far positions differ [m]."""
    truth = reference.predict(twin_of(traffic.intersection), twin, assignment[0], **how)  # type: ignore[arg-type]
    decisions = np.ascontiguousarray(truth.enters[None, :50].astype(np.uint8))
    farthest = 0.0
    creeps = (truth.speed < CREEPING) & may_creep
    in_step = creeps.copy()  # an acceleration lies between the speeds of its step; the last one is stored twice
    in_step[:-1] |= creeps[1:]
    in_step[-1] |= in_step[-2]
    for isa in _core.available_kernels():
        results = predictor.predict(traffic.core, assignment, True, True, decisions, isa)
        position, speed, acceleration, enters, present, time_loss, distance, *_ = results
        np.testing.assert_array_equal(present[0].astype(bool), truth.present, err_msg=isa)
        np.testing.assert_array_equal(enters[0].astype(bool), truth.enters, err_msg=isa)
        np.testing.assert_allclose(position[0], truth.position, atol=TRAJECTORY_TOLERANCE, err_msg=isa)
        farthest = max(farthest, float(np.abs(position[0] - truth.position).max(initial=0.0)))
        _assert_close(speed[0], truth.speed, SPEED_TOLERANCE, creeps, isa)
        _assert_close(acceleration[0], truth.acceleration, ACCELERATION_TOLERANCE, in_step, isa)
        np.testing.assert_allclose(time_loss[0], truth.time_loss, atol=1e-3, err_msg=isa)
        np.testing.assert_allclose(distance[0], truth.minimum_distance, atol=2e-3, err_msg=isa)
    return farthest


def _assert_close(
    found: NDArray[np.float32], wanted: NDArray[np.float64], tolerance: float, creeps: NDArray[np.bool_], isa: str
) -> None:
    for where, times in ((~creeps, 1.0), (creeps, SCATTER)):
        np.testing.assert_allclose(found[where], wanted[where], atol=times * tolerance, err_msg=isa)
