"""The benchmark's drivers drive, its parts run, and a peer that is missing is said to be missing."""

from __future__ import annotations

import subprocess
from typing import Any

import numpy as np
import pytest
import torch

from experiments.bench import doors as door_bench
from experiments.bench import drivers as idm_driver
from experiments.bench import environment_peers as peers
from experiments.bench import environments as environment_bench
from experiments.bench.own_process import NOT_INSTALLED
from experiments.show.environment_speed import environments_section
from intersection_env import ClosedLoopWorlds, ReplayWorlds
from intersection_env.features import Driving


def observation(**seen: float) -> np.ndarray[Any, np.dtype[np.float32]]:
    row = np.zeros(12, np.float32)
    for column, value in {
        Driving.DISTANCE_TO_STOP_LINE: seen.get("to_line", 50.0),
        Driving.SPEED: seen.get("speed", 5.0),
        Driving.V_MAX: 13.0,
        Driving.LEAD_DISTANCE: seen.get("to_lead", 100.0),
        Driving.LEAD_SPEED: seen.get("lead_speed", 27.8),
        Driving.ENTERS: seen.get("enters", 1.0),
    }.items():
        row[column] = value
    return row


def test_the_idm_goes_waits_follows_and_never_backs() -> None:
    assert idm_driver.idm_actions(observation()) > 0.3
    assert idm_driver.idm_actions(observation(to_line=5.0, enters=0.0)) < -0.3
    assert idm_driver.idm_actions(observation(to_line=5.0)) > 0.3
    assert idm_driver.idm_actions(observation(to_lead=5.0, lead_speed=0.0)) < -0.3
    assert idm_driver.idm_actions(observation(speed=0.0, to_line=0.5, enters=0.0)) == 0.0


def test_packed_parameters_are_what_the_core_evaluates() -> None:
    torch.manual_seed(0)
    layers = [torch.nn.Linear(*size) for size in ((12, 16), (16, 16), (16, 1))]
    shift, scale = np.linspace(-3.0, 20.0, 12), np.linspace(0.02, 0.5, 12)
    network = idm_driver._packed(layers, shift.astype(np.float32), scale.astype(np.float32))
    worlds = ClosedLoopWorlds(worlds=3)
    worlds.reset(0)
    seen = worlds.observation.copy()
    shape = (3, 1, 12)
    floats = [np.zeros(shape, np.float32) for _ in range(5)]
    flags = [np.zeros(shape, np.bool_) for _ in range(2)]
    first = np.zeros((*shape, 12), np.float32)
    worlds.core.rollout(network, network, 1e-6, 1, first, *floats, *flags)  # type: ignore[arg-type]
    np.testing.assert_array_equal(first[:, 0], seen)
    np.testing.assert_allclose(np.tanh(floats[0][:, 0]), idm_driver.network_output(network, seen), atol=2e-5)
    scaled = torch.from_numpy(((seen - shift) * scale).astype(np.float32))
    direct = torch.tanh(layers[2](torch.tanh(layers[1](torch.tanh(layers[0](scaled)))))).squeeze(-1)
    np.testing.assert_allclose(idm_driver.network_output(network, seen), direct.detach().numpy(), atol=2e-5)


def test_the_fitted_network_keeps_traffic_going(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who neither brakes nor accelerates ends 3.7 % of the worlds with every step."""
    for name, value in {"ROUNDS": 2, "WORLDS": 16, "ADAM_STEPS": 300}.items():
        monkeypatch.setattr(idm_driver, name, value)
    network = idm_driver.fitted_network()
    worlds = ClosedLoopWorlds(worlds=64, gap="gap")
    worlds.reset(5, desynchronise=True)
    ended, speeds = 0, []
    for _ in range(150):
        worlds.action[:] = idm_driver.network_output(network, worlds.observation)
        worlds.step()
        ended += int(worlds.done.sum())
        speeds.append(worlds.observation[..., Driving.SPEED].mean())
    assert ended / 64 / 150 < 0.02
    assert np.mean(speeds) > 6.0


@pytest.mark.parametrize("driver", ["idm", "random", "expert"])
def test_steps_are_repeated_from_the_same_state(driver: str) -> None:
    worlds = ReplayWorlds(worlds=4) if driver == "expert" else ClosedLoopWorlds(worlds=2, vehicles=4)
    run, ends = environment_bench.step_run(worlds, driver)
    count, seconds = run()
    first = worlds.observation.copy()
    assert (count, seconds > 0.0) == (2000 * worlds.action.size, True)
    assert run()[0] == count
    np.testing.assert_array_equal(worlds.observation, first)
    assert 0.0 < ends < 0.2


def test_rollouts_and_doors_are_counted_in_agent_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    network = np.zeros(497, np.float32)
    run, ends = environment_bench.rollout_run(ClosedLoopWorlds(worlds=16, vehicles=4), network)
    assert run()[0] >= 16 * 4 * environment_bench.ROLLOUT_STEPS
    assert 0.0 <= ends < 0.5
    assert [door_bench.parallel_env_run(20)()[0], door_bench.make_vec_run(20)()[0], door_bench.make_run(20)()[0]] == [
        20 * 12,
        20 * 64,
        20,
    ]
    assert door_bench.frame_milliseconds(3)["least"] > 0.0


def test_a_peer_that_is_missing_or_crashes_is_said_to_be_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def ends_with(status: int, said: str = "") -> None:
        done = subprocess.CompletedProcess([], status, said, "")
        monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)

    ends_with(NOT_INSTALLED)
    assert peers.peer_rates()[-1] == {"name": "libsumo on our Bendplatz", "missing": "not installed"}
    ends_with(-11)
    assert peers.peer_rates()[-1]["missing"] == "failed with exit status -11"
    ends_with(0, '\n{"unit": "x", "doing": "y", "rate": {"median": 1.0, "least": 1.0, "best": 1.0}}\n')
    assert peers.peer_rates()[-1]["doing"] == "y"


def test_a_module_that_is_not_there_is_told_by_the_exit_status(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> dict[str, Any]:
        raise ModuleNotFoundError("No module named 'libsumo'")

    monkeypatch.setitem(peers.PEERS, "libsumo on our Bendplatz", absent)
    monkeypatch.setattr("sys.argv", ["peers", "libsumo on our Bendplatz"])
    with pytest.raises(SystemExit) as ended:
        peers.main()
    assert ended.value.code == NOT_INSTALLED


def test_tables_show_every_rate_and_what_is_missing() -> None:
    rate = {"median": 31.26e6, "least": 1.0, "best": 4e7}
    slow = {"median": 53.0, "least": 1.0, "best": 4e7}
    block = environments_section(
        {
            "worlds": [{"name": "loop", "rates": {"v3": rate, "v4": rate}, "ends_per_world_step": 0.0123}],
            "threads": [{"name": "replay, 64 worlds", "median": 0.978, "least": 0.9, "most": 1.1}],
            "doors": [{"name": "door", "rate": {"median": 8.123e5}}],
            "peers": [{"name": "a", "rate": slow, "doing": "2 agents"}, {"name": "b", "missing": "not installed"}],
            "reference_gflops": [{"median": 100.0, "core_share": 0.99}, {"median": 90.0, "core_share": 0.95}],
            "frame_ms": {"median": 1.66},
        }
    )
    for line in ("| loop | 31.3 | 31.3 | 1.2 % |", "| door | 812 | |", "| a | 0.05 | 2 agents |"):
        assert line in block
    assert "| b | not installed |  |" in block
    assert "| replay, 64 worlds | 0.98 (0.90 to 1.10) |" in block
    assert "takes 1.7 ms" in block
    assert "with 99, 95 % of a core" in block
