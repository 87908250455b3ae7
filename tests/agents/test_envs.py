"""The worlds as TorchRL environments, held against the plain worlds."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.collectors import Collector
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import RewardSum
from torchrl.envs.utils import check_env_specs
from torchrl.objectives.value import GAE

from agents.networks.driving import Driver
from intersection_env.features import Driving
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.replay import ReplayWorlds
from tests.support.networks import driver
from tests.support.torchrl_envs import BOTH, GAMMA, LAMBDA, Env, closed_loop, recursion, replay


def agents_of(env: Env, data: TensorDictBase) -> TensorDictBase:
    """Where the agents' entries are."""
    return data if env.group is None else data[env.group]


def key(env: Env, name: str) -> str | tuple[str, str]:
    """An agents' entry from the root."""
    return name if env.group is None else (env.group, name)


def cautious(env: Env, seed: int) -> TensorDictModule:
    """Random actions by which vehicles get somewhere."""
    generator = torch.Generator().manual_seed(seed)

    def act(seen: Tensor) -> Tensor:
        return (0.05 + 0.2 * torch.randn(*seen.shape[:-1], 1, generator=generator)).clamp(-1, 1)

    return TensorDictModule(act, [key(env, "observation")], [key(env, "action")])


def drive(env: Env, steps: int, seed: int = 0) -> TensorDictBase:
    """A rollout through ends."""
    return env.rollout(steps, cautious(env, seed), break_when_any_done=False)


@BOTH
def test_specs_tell_what_the_environment_gives(make: Callable[..., Env]) -> None:
    env = make()
    check_env_specs(env, break_when_any_done="both")
    check_env_specs(env, break_when_any_done="both", seed=1)
    check_env_specs(make(worlds=1), break_when_any_done="both")
    check_env_specs(copy.deepcopy(env), break_when_any_done="both")


def test_closed_loop_gives_what_the_worlds_give_and_cuts_lives_where_they_do() -> None:
    env, twin = closed_loop(), ClosedLoopWorlds(worlds=8, max_cycles=60)
    env.set_seed(4)
    data = drive(env, 300)
    twin.reset(4, desynchronise=True)
    agents, after = data["agents"], data["next", "agents"]
    reinsertions = terminations = ends = 0
    for step in range(300):
        np.testing.assert_array_equal(agents["observation"][:, step], twin.observation)
        assert not agents["done"][:, step].any()
        twin.action[:] = agents["action"][:, step, :, 0].numpy()
        twin.step()
        cut = twin.terminated | twin.truncated | twin.reinserted
        last = np.where(cut[..., None], twin.final_observation, twin.observation)
        np.testing.assert_array_equal(after["observation"][:, step], last)
        np.testing.assert_array_equal(after["reward"][:, step, :, 0], twin.reward)
        np.testing.assert_array_equal(after["done"][:, step, :, 0], cut)
        np.testing.assert_array_equal(after["terminated"][:, step, :, 0], twin.terminated)
        np.testing.assert_array_equal(after["truncated"][:, step, :, 0], cut & ~twin.terminated)
        reinsertions += int(twin.reinserted.sum())
        terminations += int(twin.terminated.sum())
        ends += int(twin.done.sum())
    assert min(reinsertions, terminations, ends) > 5


def test_a_reinsertion_ends_one_life_and_no_other() -> None:
    data = drive(closed_loop(max_cycles=2000), 200)
    done = data["next", "agents", "done"][:, :-1, :, 0]
    alone = done & ~done.all(dim=2, keepdim=True)
    before, after = data["next", "agents", "observation"][:, :-1], data["agents", "observation"][:, 1:]
    assert alone.sum() > 5
    assert (before[~done] == after[~done]).all()
    line = Driving.DISTANCE_TO_STOP_LINE  # negative for who has left, some 70 m or more for who begins
    assert (before[alone][:, line] < 0).all()
    assert (after[alone][:, line] > 30).all()
    assert data["next", "agents", "truncated"][:, :-1, :, 0][alone].all()


def test_replay_gives_what_the_worlds_give() -> None:
    env, twin = replay(), ReplayWorlds(worlds=8)
    env.set_seed(4)
    data = drive(env, 200)
    twin.reset(4, desynchronise=True)
    for step in range(200):
        np.testing.assert_array_equal(data["observation"][:, step], twin.observation)
        twin.action[:] = data["action"][:, step, 0].numpy()
        twin.step()
        cut = twin.terminated | twin.truncated
        last = np.where(cut[:, None], twin.final_observation, twin.observation)
        np.testing.assert_array_equal(data["next", "observation"][:, step], last)
        np.testing.assert_array_equal(data["next", "reward"][:, step, 0], twin.reward)
        np.testing.assert_array_equal(data["next", "terminated"][:, step, 0], twin.terminated)
        np.testing.assert_array_equal(data["next", "truncated"][:, step, 0], twin.truncated)
    assert data["next", "terminated"].any()
    assert data["next", "truncated"].any()


@BOTH
def test_what_was_handed_out_stays_as_it_was(make: Callable[..., Env]) -> None:
    env = make()
    first = env.reset()
    data = env.step(env.rand_action(first))
    kept = data.clone()
    for _ in range(5):
        _, following = env.step_and_maybe_reset(env.rand_action(data.exclude("next")))
    assert (data.exclude(key(env, "action")) == kept.exclude(key(env, "action"))).all()
    assert (agents_of(env, following)["observation"] != agents_of(env, kept)["observation"]).any()


@BOTH
def test_a_seed_decides_the_rollout(make: Callable[..., Env]) -> None:
    env = make()
    rollouts = []
    for seed in (1, 1, 2):
        env.set_seed(seed)
        rollouts.append(drive(env, 40))
    assert (rollouts[0] == rollouts[1]).all()
    starts = [agents_of(env, data)["observation"][:, 0] for data in (rollouts[0], rollouts[2])]
    assert (starts[0] != starts[1]).any()
    assert (agents_of(env, env.reset())["observation"] != starts[1]).any(), "a reset without a seed goes on"


@BOTH
def test_a_state_is_gone_back_to(make: Callable[..., Env]) -> None:
    env = make()
    drive(env, 30)
    state = env.state()
    shots = []
    for _ in range(2):
        start = env.set_state(state)
        shots.append(env.rollout(40, cautious(env, 7), break_when_any_done=False, auto_reset=False, tensordict=start))
    assert (shots[0] == shots[1]).all()


@BOTH
def test_a_refused_seed_leaves_the_environment_as_it_was(make: Callable[..., Env]) -> None:
    env = make()
    env.set_seed(3)
    for seed in (-1, True):
        with pytest.raises((TypeError, ValueError), match="seed is"):
            env.set_seed(seed)
    twin = make()
    twin.set_seed(3)
    assert (agents_of(env, env.reset())["observation"] == agents_of(twin, twin.reset())["observation"]).all()


@BOTH
@pytest.mark.parametrize(
    ("spoil", "error", "message"),
    [
        (lambda state: state | {"mood": state["done"]}, ValueError, 'no array "mood"'),
        (lambda state: state | {"speed": state["speed"].T[None]}, ValueError, '"speed" of the state has shape'),
        (
            lambda state: state | {"speed": state["speed"].astype(np.float64)},
            TypeError,
            '"speed" of the state is float64',
        ),
        (lambda state: {name: state[name] for name in state if name != "done"}, ValueError, '"done" .* is missing'),
        (lambda state: state | {"random": state["random"] * 0}, ValueError, '"random" of the state, world 0'),
        (lambda state: None, TypeError, "must be a dict"),
    ],
)
def test_a_state_of_other_worlds_is_refused(
    make: Callable[..., Env], spoil: Callable[[Any], Any], error: type[Exception], message: str
) -> None:
    env = make()
    env.reset()
    state = env.state()
    with pytest.raises(error, match=message):
        env.set_state(spoil(state))
    assert all((values == state[name]).all() for name, values in env.state().items())


@pytest.mark.parametrize("cycle", [-1, 61])
def test_a_state_beyond_the_last_cycle_is_refused(cycle: int) -> None:
    env = closed_loop()
    env.reset()
    state = env.state()
    state["cycle"][2] = cycle
    with pytest.raises(ValueError, match=f'"cycle" of the state, world 2: {cycle}; wanted 0 to 60'):
        env.set_state(state)


@BOTH
def test_a_reset_of_some_worlds_leaves_the_others(make: Callable[..., Env]) -> None:
    env = make()
    before = env.reset()
    mask = torch.zeros(*env.worlds.action.shape, 1, dtype=torch.bool)
    mask[2] = True
    asked = before.clone()
    agents_of(env, asked).set("_reset", mask)
    after = env.reset(asked)
    one, other = agents_of(env, before)["observation"], agents_of(env, after)["observation"]
    others = torch.arange(8) != 2
    assert (one[others] == other[others]).all()
    assert (one[2] != other[2]).any()


def test_a_world_that_has_just_restarted_can_be_reset_again() -> None:
    env = closed_loop(max_cycles=1)
    _, first = env.step_and_maybe_reset(env.rand_action(env.reset()))
    asked = TensorDict({"agents": TensorDict({"_reset": torch.ones(8, 12, 1, dtype=torch.bool)}, (8, 12))}, (8,))
    second = env.reset(asked)
    differs = first["agents", "observation"] != second["agents", "observation"]
    assert differs.flatten(1).any(dim=1).all()


def test_a_vehicle_alone_is_not_restarted() -> None:
    env = closed_loop()
    data = env.reset()
    mask = torch.zeros(8, 12, 1, dtype=torch.bool)
    mask[2, 3] = True
    with pytest.raises(ValueError, match="restart together"):
        env.reset(TensorDict({"agents": TensorDict({"_reset": mask}, (8, 12))}, (8,)))
    with pytest.raises(ValueError, match="not at the root"):
        env.reset(TensorDict({"_reset": mask.any(1)}, (8,)))
    assert (env.worlds.observation == data["agents", "observation"].numpy()).all()


@BOTH
@pytest.mark.parametrize("value", [1.001, float("nan"), float("-inf")])
def test_an_impossible_action_is_refused(make: Callable[..., Env], value: float) -> None:
    env = make()
    data = env.rand_action(env.reset())
    before = env.worlds.observation.copy()
    bad = data.clone()
    agents_of(env, bad)["action"].view(-1)[5] = value
    with pytest.raises(ValueError, match="an action is"):
        env.step(bad)
    np.testing.assert_array_equal(env.worlds.observation, before)
    env.step(data)


def test_transforms_keep_to_the_lives_of_vehicles() -> None:
    env = TransformedEnv(closed_loop(), RewardSum([("agents", "reward")], [("agents", "sum")]))
    data = env.rollout(100, cautious(env.base_env, 0), break_when_any_done=False)
    reward, done = data["next", "agents", "reward"], data["next", "agents", "done"]
    total = torch.zeros_like(reward[:, 0])
    for step in range(100):
        total = total + reward[:, step]
        torch.testing.assert_close(data["next", "agents", "sum"][:, step], total)
        total = total * ~done[:, step]
    assert (done.any(dim=2) & ~done.all(dim=2)).any()


# TorchRL's own collector and estimator on them


class Actor(torch.nn.Module):
    """An action around the policy's, by torch's chance."""

    def __init__(self, of: Driver) -> None:
        super().__init__()
        self.of = of

    def forward(self, observation: Tensor) -> Tensor:
        mean: Tensor = self.of.policy(observation).unsqueeze(-1)
        return torch.tanh(mean + self.of.sigma * torch.randn_like(mean))


@BOTH
def test_torchrls_collector_and_gae_take_the_environment(make: Callable[..., Env]) -> None:
    env, of = make(), driver()
    actor = TensorDictModule(Actor(of), [key(env, "observation")], [key(env, "action")])
    frames = {"frames_per_batch": 8 * 30, "total_frames": 3 * 8 * 30}
    collector = Collector(env, actor, **frames, auto_register_policy_transforms=False)
    critic = TensorDictModule(
        lambda seen: of.value(seen).unsqueeze(-1), [key(env, "observation")], [key(env, "state_value")]
    )
    gae = GAE(gamma=GAMMA, lmbda=LAMBDA, value_network=critic)
    names = ("advantage", "value_target", "value", "reward", "done", "terminated")
    gae.set_keys(**{name: key(env, "state_value" if name == "value" else name) for name in names})
    seen = cuts = 0
    with torch.no_grad():
        for data in collector:
            gae(data)
            flat = TensorDict(
                {
                    **agents_of(env, data).exclude("next").to_dict(),
                    "next": agents_of(env, data["next"]).to_dict(),
                }
            )
            torch.testing.assert_close(flat["advantage"].double(), recursion(flat), atol=1e-2, rtol=1e-4)
            following = of.value(flat["next", "observation"]).unsqueeze(-1)
            torch.testing.assert_close(flat["next", "state_value"], following)
            seen += data.numel()
            cuts += int(flat["next", "done"].sum())
    collector.shutdown()
    assert seen == 3 * 8 * 30
    assert cuts > 5
