"""What drivers are paid in every environment that has an id: a random one, the IDM, and the policies that ship.

python -m experiments.returns
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from experiments.results_files import write_result
from experiments.show.environment_returns import returns_table
from imitation.torch_networks import Networks, View
from intersection_env import VARIANTS, ClosedLoopWorlds, ReplayWorlds, Variant
from intersection_env.constants import ACCELERATION, DT
from intersection_env.envs.variants import REPLAY
from intersection_env.evaluation.intervals import interval
from intersection_env.features import Driving
from intersection_env.policies.file import IdmParameters
from intersection_env.policies.named import policy_named

SEED = 2**42  # of no training
MAX_CYCLES = 2000  # of the closed loop, by default
LEAST_GAP = 0.1  # [m], the core's, where bumpers touch
RANDOM, IDM = "random", "idm"

Driver = Callable[[Tensor], Tensor]
"""What is seen (..., 12) to actions (...,) in [-1, 1]."""
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """Baseline returns."""

    drivers: tuple[str, ...] = (RANDOM, IDM, "ppo", "gail", "rollout_gradient")
    """Random, IDM, and names of shipped policies, or policy files, with a driving network."""
    worlds: int = 64
    """Of the closed loop, one episode each."""
    episodes: int = 1000
    """Of the replay."""
    out: Path = Path("experiments/results")
    """The folder of the results file, "returns.json"."""


def driver_named(name: str, seed: int = SEED) -> Driver:
    """Who drives: chance, the IDM, or a policy as in predictions, within their limits; nobody but chance backs.

    Raises:
        ValueError: no such policy, or one without networks.
        OSError: its file cannot be read.
    """
    if name == RANDOM:
        generator = torch.Generator().manual_seed(seed)
        return lambda seen: 2.0 * torch.rand(seen.shape[:-1], generator=generator) - 1.0
    if name == IDM:
        return lambda seen: _action(idm(seen), seen)
    policy, _ = policy_named(name)
    if policy.driving_network is None or policy.gap_network is None:
        raise ValueError(f'the policy "{name}" has no driving network; wanted one, "{RANDOM}" or "{IDM}"')
    networks = Networks.of(policy)
    return lambda seen: _action(networks.drive(*View.of(seen)), seen)


def idm(seen: Tensor, parameters: IdmParameters = IdmParameters()) -> Tensor:  # noqa: B008, it is frozen
    """The accelerations (...,) [m/s²] of the IDM that slows for no bends, by what is seen (..., 12)."""
    p = parameters
    view, enters = View.of(seen)
    speed, free_speed = view.speed, p.speed_share * view.v_max

    def behind(gap: Tensor, lead_speed: Tensor) -> Tensor:
        approach = (speed - lead_speed) / (2.0 * (p.acceleration * p.deceleration) ** 0.5) + p.time_gap
        wanted = (p.standing_gap + (speed * approach).clamp(min=0.0)) / gap.clamp(min=LEAST_GAP)
        reach = (free_speed - speed) / (DT * p.acceleration)
        road = 1.0 - (speed / free_speed) ** 4
        road = road.maximum(reach.clamp(max=0.0)).minimum(reach.clamp(min=0.0))
        acceleration: Tensor = p.acceleration * (road - wanted.square())
        return acceleration

    follow = behind(view.to_lead, view.lead_speed)
    stop = behind(view.to_line, torch.zeros_like(speed))
    return torch.where(enters, follow, follow.minimum(stop)).clamp(-p.deceleration_limit, p.acceleration)


def _action(acceleration: Tensor, seen: Tensor) -> Tensor:
    to_standstill = -seen[..., Driving.SPEED].clamp(min=0.0) / DT
    return (acceleration.maximum(to_standstill) / ACCELERATION).clamp(-1.0, 1.0)


def closed_loop_returns(variant: Variant, driver: Driver, worlds: int) -> dict[str, Floats]:
    """Return and steps of an episode (vehicle, 2), by world."""
    most = variant.max_episode_steps or MAX_CYCLES
    simulated = ClosedLoopWorlds(**variant.arguments, worlds=worlds, max_cycles=most, autoreset="off")
    simulated.reset(SEED)
    paid, steps = np.zeros(simulated.reward.shape), np.zeros(simulated.reward.shape)
    going = np.ones((worlds, 1), np.bool_)
    while going.any():
        simulated.action[:] = driver(torch.from_numpy(simulated.observation)).numpy()
        simulated.step()
        paid += np.where(going, simulated.reward, 0.0)
        steps += going
        going &= ~simulated.done[:, None]
    return {str(world): one for world, one in enumerate(np.stack((paid, steps), axis=-1))}


def replay_returns(variant: Variant, driver: Driver, episodes: int) -> dict[str, Floats]:
    """Return and steps of episodes (episode, 2), by the recording that they are of."""
    simulated = ReplayWorlds(**variant.arguments, worlds=episodes, autoreset="off")
    simulated.reset(SEED)
    most = variant.max_episode_steps or np.inf
    paid, steps, going = np.zeros(episodes), np.zeros(episodes), np.ones(episodes, np.bool_)
    recording = np.array([simulated.tracks.scenes[one].recording for one in simulated.tracks.scene_number.tolist()])
    of = recording[simulated.track]
    while going.any():
        simulated.action[:] = driver(torch.from_numpy(simulated.observation)).numpy()
        simulated.step()
        paid += np.where(going, simulated.reward, 0.0)
        steps += going
        going &= ~(simulated.terminated | simulated.truncated) & (steps < most)
    both = np.stack((paid, steps), axis=-1)
    return {str(one): both[of == one] for one in np.unique(of)}


def environment_returns(options: Options) -> dict[str, Any]:
    """By variant and driver: the mean "return" of an episode and agent with its interval, and its mean "steps".

    Raises:
        ValueError, OSError: as of `driver_named`.
    """
    drivers = {Path(name).stem: name for name in options.drivers}
    found: dict[str, Any] = {}
    with tqdm(total=len(VARIANTS) * len(drivers), desc="returns", disable=None) as bar:
        for variant in VARIANTS:
            found[variant.name] = {}
            for label, name in drivers.items():
                driver = driver_named(name)
                if variant.kind == REPLAY:
                    samples = replay_returns(variant, driver, options.episodes)
                else:
                    samples = closed_loop_returns(variant, driver, options.worlds)
                found[variant.name][label] = _summary(samples)
                bar.update()
    return {"worlds": options.worlds, "episodes": options.episodes, "variants": found}


def _summary(samples: Mapping[str, Floats]) -> dict[str, Any]:
    paid = interval({name: rows[:, 0] for name, rows in samples.items()}, lambda rows: float(rows.mean()))
    return {"return": paid, "steps": float(np.concatenate([rows[:, 1] for rows in samples.values()]).mean())}


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    torch.set_num_threads(1)  # such small networks gain nothing from more
    try:
        results = environment_returns(options)
        print(returns_table(results))
        write_result(options.out / "returns.json", results)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
