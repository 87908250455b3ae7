"""The worlds under TorchRL: environments, collectors and rollouts in the core, held against the plain worlds."""

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
from torchrl.envs import PettingZooWrapper, TransformedEnv
from torchrl.envs.transforms import RewardSum
from torchrl.envs.utils import check_env_specs
from torchrl.modules import IndependentNormal, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from agents.networks.driving import Driver, DrivingNetwork
from agents.rollouts.collector import RolloutCollector, Rollouts
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv
from intersection_env import parallel_env
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.replay import ReplayWorlds

Env = ClosedLoopEnv | ReplayEnv
GAMMA, LAMBDA = 0.99, 0.9
NETWORK_TOLERANCE = 1e-5
"""How far the core's networks may be from torch's; its tanh is good to 5e-7."""


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


def closed_loop(**arguments: Any) -> ClosedLoopEnv:
    """Eight worlds that end soon."""
    return ClosedLoopEnv(**({"worlds": 8, "max_cycles": 60, "desynchronise": True} | arguments))


def replay(**arguments: Any) -> ReplayEnv:
    return ReplayEnv(**({"worlds": 8, "desynchronise": True} | arguments))


BOTH = pytest.mark.parametrize("make", [closed_loop, replay])


def driver() -> Driver:
    """Random weights, moderate actions."""
    return Driver(DrivingNetwork(), DrivingNetwork(), 0.3)


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


def recursion(data: TensorDictBase) -> Tensor:
    """Advantages (world, step, ...) one step after the other, in float64; every done cuts."""
    value, reward = data["state_value"].double(), data["next", "reward"].double()
    following = data["next", "state_value"].double() * ~data["next", "terminated"]
    advantage, last = torch.zeros_like(value), torch.zeros_like(value[:, 0])
    for step in reversed(range(value.shape[1])):
        delta = reward[:, step] + GAMMA * following[:, step] - value[:, step]
        last = delta + GAMMA * LAMBDA * last * ~data["next", "done"][:, step]
        advantage[:, step] = last
    return advantage


# The environments


@BOTH
def test_specs_tell_what_the_environment_gives(make: Callable[..., Env]) -> None:
    env = make()
    check_env_specs(env, break_when_any_done="both")
    check_env_specs(env, break_when_any_done="both", seed=1)
    check_env_specs(make(worlds=1), break_when_any_done="both")
    check_env_specs(copy.deepcopy(env), break_when_any_done="both")


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL:UserWarning")  # theirs: they test another version
def test_pettingzoo_wrapper_gives_the_same_specs_and_numbers() -> None:
    wrapped = PettingZooWrapper(parallel_env(vehicles=3, max_cycles=20), use_mask=True, done_on_any=False)
    check_env_specs(wrapped, break_when_any_done="both")
    wrapped.set_seed(3)
    data = wrapped.rollout(50, break_when_any_done=False)
    own = ClosedLoopWorlds(worlds=1, vehicles=3, max_cycles=20)
    own.reset(3)
    own.reset_worlds(np.ones(1, np.bool_))  # `set_seed` resets, and the rollout once more
    ends = data["next", "done"].squeeze(-1).nonzero().flatten().tolist()
    assert len(ends) >= 2
    for step in range(ends[0] + 1):
        np.testing.assert_array_equal(data["vehicle", "observation"][step], own.observation[0])
        own.action[:] = data["vehicle", "action"][step].squeeze(-1).numpy()
        own.step()
        np.testing.assert_array_equal(data["next", "vehicle", "reward"][step].squeeze(-1), own.reward[0])


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
    line = 0  # d_stop: negative for who has left, some 70 m or more for who begins
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


# Rollouts in the core


def started(make: Callable[..., Env], seed: int = 0, **arguments: Any) -> Env:
    env = make(**arguments)
    env.set_seed(seed)
    env.reset()
    return env


@BOTH
def test_log_probabilities_and_values_of_a_rollout_are_the_networks(make: Callable[..., Env]) -> None:
    env, of = started(make, worlds=40), driver()
    data = Rollouts(env.worlds, 100).collect(of)
    with torch.no_grad():
        latent = torch.distributions.Normal(of.policy(data["observation"]), of.sigma)
        value, last = of.value(data["observation"]), of.value(torch.from_numpy(env.worlds.observation))
    expected = latent.log_prob(data["action"].squeeze(-1))  # type: ignore[no-untyped-call]
    torch.testing.assert_close(data["action_log_prob"], expected, atol=NETWORK_TOLERANCE, rtol=0)
    torch.testing.assert_close(data["state_value"].squeeze(-1), value, atol=NETWORK_TOLERANCE, rtol=0)
    done, following = data["next", "done"], data["next", "state_value"]
    assert done.sum() > 20
    assert data["next", "terminated"].sum() > 5
    assert not (data["next", "terminated"] & ~done).any()
    goes_on = ~done[:, :-1]
    torch.testing.assert_close(following[:, :-1][goes_on], data["state_value"][:, 1:][goes_on], atol=0, rtol=0)
    goes_on = ~done[:, -1]
    torch.testing.assert_close(following[:, -1][goes_on], last.unsqueeze(-1)[goes_on], atol=NETWORK_TOLERANCE, rtol=0)
    score = (data["action"].squeeze(-1) - latent.mean) / latent.stddev
    assert abs(float(score.mean())) < 4 * score.numel() ** -0.5
    assert abs(float(score.std()) - 1) < 4 * (2 * score.numel()) ** -0.5


@BOTH
def test_a_rollout_does_what_steps_with_its_actions_do(make: Callable[..., Env]) -> None:
    env, twin, of = started(make, worlds=40), make(worlds=40).worlds, driver()
    rollouts, cuts = Rollouts(env.worlds, 1), 0
    for _ in range(80):
        twin.set_state(env.state())
        data = rollouts.collect(of)[:, 0]
        np.testing.assert_array_equal(data["observation"], twin.observation)
        twin.action[:] = torch.tanh(data["action"]).squeeze(-1).numpy()
        twin.step()
        cut = twin.terminated | twin.truncated | getattr(twin, "reinserted", False)
        np.testing.assert_array_equal(data["next", "done"].squeeze(-1), cut)
        np.testing.assert_array_equal(data["next", "terminated"].squeeze(-1), twin.terminated)
        np.testing.assert_allclose(data["next", "reward"].squeeze(-1), twin.reward, atol=0.02, rtol=1e-4)
        with torch.no_grad():
            last = of.value(torch.from_numpy(np.where(cut[..., None], twin.final_observation, twin.observation)))
        torch.testing.assert_close(data["next", "state_value"].squeeze(-1), last, atol=1e-4, rtol=0)
        cuts += int(cut.sum())
    assert cuts > 20


@BOTH
def test_gae_of_a_rollout_is_the_recursion_that_every_end_cuts(make: Callable[..., Env]) -> None:
    env = started(make, worlds=20)
    data = Rollouts(env.worlds, 64).collect(driver())
    GAE(gamma=GAMMA, lmbda=LAMBDA, value_network=None)(data)
    expected = recursion(data)
    assert data["next", "done"][:, :-1].sum() > 5
    torch.testing.assert_close(data["advantage"].double(), expected, atol=1e-2, rtol=1e-4)
    target = expected + data["state_value"].double()
    torch.testing.assert_close(data["value_target"].double(), target, atol=1e-2, rtol=1e-4)


@BOTH
def test_a_rollout_feeds_the_ppo_loss(make: Callable[..., Env]) -> None:
    env, of = started(make, worlds=20), driver()
    data = Rollouts(env.worlds, 64).collect(of)
    GAE(gamma=GAMMA, lmbda=LAMBDA, value_network=None)(data)

    class Mean(torch.nn.Module):
        def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
            mean = of.policy(observation).unsqueeze(-1)
            return mean, of.sigma.expand_as(mean)

        policy = of.policy

    actor = ProbabilisticActor(
        TensorDictModule(Mean(), ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        distribution_kwargs={"tanh_loc": False},
        return_log_prob=True,
    )

    class Value(torch.nn.Module):
        value = of.value

        def forward(self, observation: Tensor) -> Tensor:
            value: Tensor = self.value(observation)
            return value.unsqueeze(-1)

    critic = TensorDictModule(Value(), ["observation"], ["state_value"])
    loss = ClipPPOLoss(actor, critic, critic_coeff=0.5, entropy_coeff=0.0, normalize_advantage=True)
    terms = loss(data.reshape(-1))
    assert abs(float(terms["kl_approx"])) < NETWORK_TOLERANCE, "the ratio is not 1 for the policy that acted"
    (terms["loss_objective"] + terms["loss_critic"]).backward()
    assert all((parameter.grad != 0).any() for parameter in loss.parameters())


def test_a_rollout_before_a_reset_is_refused() -> None:
    with pytest.raises(RuntimeError, match="reset"):
        Rollouts(closed_loop().worlds, 4).collect(driver())
    with pytest.raises(ValueError, match="steps"):
        Rollouts(closed_loop().worlds, 0)


# The collector around them


def batches(collector: RolloutCollector) -> list[TensorDictBase]:
    return [batch.clone() for batch in collector]


def collector(
    make: Callable[..., Env] = closed_loop, steps: int = 20, count: int = 4, **others: Any
) -> RolloutCollector:
    env = make()
    torch.manual_seed(5)
    frames = env.worlds.action.size * steps
    return RolloutCollector(env, driver(), frames_per_batch=frames, total_frames=count * frames, **others)


@BOTH
def test_a_seed_decides_what_is_collected(make: Callable[..., Env]) -> None:
    collected = []
    for seed in (1, 1, 2):
        of = collector(make)
        assert isinstance(of.set_seed(seed), int)
        collected.append(batches(of))
    assert len(collected[0]) == len(collector(make)) == 4
    assert all((one == other).all() for one, other in zip(collected[0], collected[1], strict=True))
    assert (collected[0][0]["observation"] != collected[2][0]["observation"]).any()
    assert (collected[0][0]["observation"] != collected[0][1]["observation"]).any()


def test_a_batch_is_valid_until_the_next_but_one() -> None:
    of = iter(collector())
    first = next(of)
    kept = first.clone()
    second = next(of)
    assert (first == kept).all()
    assert first["observation"].data_ptr() != second["observation"].data_ptr()
    assert next(of)["observation"].data_ptr() == first["observation"].data_ptr()


@BOTH
def test_a_collector_goes_on_from_its_state(make: Callable[..., Env]) -> None:
    whole = collector(make)
    whole.set_seed(3)
    steps = iter(whole)
    next(steps)
    state = copy.deepcopy(whole.state_dict())
    rest = [batch.clone() for batch in steps]
    other = collector(make)
    with torch.no_grad():
        other.policy.policy.first.weight.zero_()
    other.load_state_dict(state)
    again = batches(other)
    assert len(rest) == len(again) == 3
    assert all((one == two).all() for one, two in zip(rest, again, strict=True))


def test_a_collector_of_two_environments_collects_what_each_does_one_after_the_other() -> None:
    def both() -> list[ClosedLoopEnv]:
        return [closed_loop(gap="critical_gap"), closed_loop(gap="gap", worlds=4)]

    of, frames = driver(), [count * 12 * 20 for count in (8, 4)]
    together = RolloutCollector(both, of, frames_per_batch=sum(frames), total_frames=-1)
    seed = together.set_seed(3)
    alone = [
        RolloutCollector(env, of, frames_per_batch=n, total_frames=-1) for env, n in zip(both(), frames, strict=True)
    ]
    following = 3
    for one in alone:
        following = one.set_seed(following)
    assert following == seed
    whole, parts = iter(together), [iter(one) for one in alone]
    for _ in range(2):
        assert (next(whole) == torch.cat([next(part) for part in parts])).all()
    state = copy.deepcopy(together.state_dict())
    expected = next(whole).clone()
    next(whole)
    together.load_state_dict(state)
    assert (next(whole) == expected).all()
    assert (next(whole) != expected).any()


def test_a_collector_takes_weights_from_elsewhere() -> None:
    of, elsewhere = collector(), driver()
    of.update_policy_weights_()
    of.update_policy_weights_(elsewhere)
    assert all((one == two).all() for one, two in zip(of.policy.parameters(), elsewhere.parameters(), strict=True))
    third = driver()
    of.update_policy_weights_(TensorDict.from_module(third))
    data = next(iter(of))
    with torch.no_grad():
        value = third.value(data["observation"])
    torch.testing.assert_close(data["state_value"].squeeze(-1), value, atol=NETWORK_TOLERANCE, rtol=0)
    with pytest.raises(KeyError, match="critic"):
        of.update_policy_weights_(third, model_id="critic")


def test_hooks_run_around_each_batch() -> None:
    seen: list[Any] = []
    of = collector(
        pre_collect_hook=lambda: seen.append("before"), post_collect_hook=lambda batch: seen.append(batch.numel())
    )
    batches(of)
    assert seen == ["before", 8 * 12 * 20] * 4
    assert of.stats()["frames"] == of.total_frames


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"frames_per_batch": 100}, ValueError, "multiple of the 96 agents"),
        ({"frames_per_batch": 0}, ValueError, "multiple"),
        ({"total_frames": 0}, ValueError, "total_frames"),
        ({"max_frames_per_traj": 100}, ValueError, "max_frames_per_traj"),
        ({"policy_device": "cuda"}, ValueError, "policy_device"),
        ({"frame_skip": 2}, TypeError, "frame_skip"),
        ({"create_env_fn": lambda: 3}, TypeError, "int"),
        ({"create_env_fn": []}, TypeError, "no environment"),
        (
            {"create_env_fn": [closed_loop, lambda: closed_loop(vehicles=6, worlds=16)], "frames_per_batch": 192},
            ValueError,
            "differ in their vehicles",
        ),
    ],
)
def test_what_a_collector_cannot_do_is_refused(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    valid: dict[str, Any] = {"create_env_fn": [closed_loop], "policy": driver(), "frames_per_batch": 96}
    RolloutCollector(**valid, total_frames=96, max_frames_per_traj=-1, split_trajs=False, device="cpu")
    with pytest.raises(error, match=message):
        RolloutCollector(**(valid | {"total_frames": 96} | arguments))
