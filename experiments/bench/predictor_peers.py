"""Times other ways to predict the same 15 vehicles, for the same run of `make bench`.

Each runs in a process of its own and one thread, `python -m experiments.bench.predictor_peers NAME`.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from data.sumo import network as sumo_network
from data.sumo.command import command_of, dense_traffic, keep_present, without_drivers
from experiments.bench.own_process import in_own_process, print_row
from experiments.bench.stopwatch import core_watch, spread
from experiments.bench.timed_traffic import VEHICLES, both_networks, traffic
from intersection_env import _core
from intersection_env.command import run_command
from intersection_env.constants import DT
from intersection_env.policies.file import NetworkWeights

REPEATS, SECONDS = 9, 0.15  # repetitions, and of each at least
SEARCHED = 600.0  # [s] of libsumo's traffic, in which 15 vehicles are found


def predictor_peer_times() -> dict[str, dict[str, Any]]:
    """By peer: microseconds a scenario (median, least, best) and what it did; or why it is missing. Prints them."""
    rows = {name: in_own_process(__name__, name) for name in PEERS}
    for name, row in rows.items():
        said = row.get("missing") or f"{row['us']['median']:,.1f} (best {row['us']['best']:,.1f}) µs; {row['doing']}"
        print(f"{name}: {said}", flush=True)
    return rows


def microseconds(work: Callable[[], object], scenarios: int) -> dict[str, float]:
    """The time of one of the scenarios that this work predicts [µs]: median, most and best over repetitions."""
    work()
    times = []
    for _ in range(REPEATS):
        calls, begin = 0, time.perf_counter()
        while calls == 0 or time.perf_counter() - begin < SECONDS:
            work()
            calls += 1
        times.append((time.perf_counter() - begin) / calls / scenarios * 1e6)
    return spread(times)


def torch_run(scenarios: int) -> dict[str, Any]:
    """The same model and networks as plain torch operations."""
    import torch

    from imitation.torch_model import TorchPredictor

    torch.set_num_threads(1)
    scene = traffic()
    predictor = TorchPredictor.of(scene, both_networks())
    assignment = torch.zeros((scenarios, len(scene.conflicts)), dtype=torch.int8)
    found = microseconds(lambda: predictor.predict(assignment), scenarios)
    asked = float(predictor.predict(assignment[:1]).asked) / _core.STEPS / len(scene.conflicts)
    return {"us": found, "doing": f"the whole model, batch of {scenarios}", "asked": asked}


def onnx_run(scenarios: int) -> dict[str, Any]:
    """Both networks alone, by onnxruntime, 50 times, with ready-made inputs."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    policy, scene = both_networks(), traffic()
    assert policy.gap_network is not None
    assert policy.driving_network is not None
    parts = (
        (policy.gap_network, "LeakyRelu", len(scene.conflicts)),
        (policy.driving_network, "Tanh", len(scene)),
    )
    calls = []
    for network, activation, rows in parts:
        session = onnxruntime.InferenceSession(onnx_model(network, activation), options)
        inputs = np.random.default_rng(0).normal(size=(scenarios * rows, len(network.shift))).astype(np.float32)
        calls.append((session, {"features": inputs}))

    def run() -> None:
        for _ in range(_core.STEPS):
            for session, inputs in calls:
                session.run(None, inputs)

    return {"us": microseconds(run, scenarios), "doing": f"both networks alone, batch of {scenarios}"}


def onnx_model(network: NetworkWeights, activation: str) -> bytes:
    """The network as ONNX, "features" (row, input) to "output" (row, 1), its scaling folded in."""
    import onnx

    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    nodes, constants, name = [], [], "features"
    for k, (weight, bias) in enumerate(network.layers):
        if k == 0:
            weight, bias = weight * network.scale, bias - weight @ (network.scale * network.shift)
        constants += [onnx.numpy_helper.from_array(weight, f"w{k}"), onnx.numpy_helper.from_array(bias, f"b{k}")]
        last = k == len(network.layers) - 1
        nodes.append(helper.make_node("Gemm", [name, f"w{k}", f"b{k}"], ["output" if last else f"s{k}"], transB=1))
        if not last:
            nodes.append(helper.make_node(activation, [f"s{k}"], [f"a{k}"]))
            name = f"a{k}"
    inputs, outputs = (
        [helper.make_tensor_value_info(one, kind, ["row", width])]
        for one, width in (("features", len(network.shift)), ("output", 1))
    )
    graph = helper.make_graph(nodes, "network", inputs, outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=10)
    return bytes(model.SerializeToString())


def libsumo_run(restores: bool) -> dict[str, Any]:
    """50 steps of 0.2 s from a state with 15 vehicles; restoring it and reading all states counts if `restores`."""
    libsumo = importlib.import_module("libsumo")
    with tempfile.TemporaryDirectory() as folder:
        source, network = sumo_network.read()
        command = command_of(network, dense_traffic(source, SEARCHED), Path(folder))
        libsumo.start(command)
        while libsumo.vehicle.getIDCount() != len(VEHICLES):
            libsumo.simulationStep()
        state = str(Path(folder) / "state.xml")
        libsumo.simulation.saveState(state)
        keep_present(Path(state))
        libsumo.close()
        libsumo.start(without_drivers(command))
        present: list[int] = []

        def step() -> None:
            for _ in range(_core.STEPS):
                libsumo.simulationStep()
                if restores:
                    for vehicle in libsumo.vehicle.getIDList():
                        libsumo.vehicle.getPosition(vehicle)
                        libsumo.vehicle.getSpeed(vehicle)

        def restore() -> None:
            libsumo.simulation.loadState(state)
            present.append(libsumo.vehicle.getIDCount())

        found = _libsumo_times(restore, step, restores)
        present.append(libsumo.vehicle.getIDCount())
        libsumo.close()
    doing = f"{present[0]} vehicles at first, {present[-1]} at last; {_core.STEPS} steps of {DT} s"
    return {"us": found, "doing": doing + (", restoring and reading included" if restores else " alone")}


def _libsumo_times(restore: Callable[[], None], step: Callable[[], None], restores: bool) -> dict[str, float]:
    times = []
    for _ in range(20 * REPEATS):
        begin = time.perf_counter()
        restore()
        if not restores:
            begin = time.perf_counter()
        step()
        times.append((time.perf_counter() - begin) * 1e6)
    return spread(times)


PEERS: dict[str, Callable[[], dict[str, Any]]] = {
    "libsumo": lambda: libsumo_run(restores=False),
    "libsumo, with restoring and reading": lambda: libsumo_run(restores=True),
    "torch, 1 scenario": lambda: torch_run(1),
    "torch, 64": lambda: torch_run(64),
    "torch, 1024": lambda: torch_run(1024),
    "onnxruntime, networks alone, 64": lambda: onnx_run(64),
    "onnxruntime, networks alone, 1024": lambda: onnx_run(1024),
}


def timed(peer: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The peer's row, and how much of a core it had."""
    core_share = core_watch()
    row = peer()
    return row | {"core_share": core_share()}


def main() -> None:
    """Times one peer and prints its row as JSON."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bench.predictor_peers", description=__doc__)
    parser.add_argument("name", choices=PEERS)
    peer = PEERS[parser.parse_args().name]
    sys.exit(print_row(lambda: timed(peer)))


if __name__ == "__main__":
    run_command(main)
