"""The batched worlds as TorchRL environments: `ClosedLoopEnv`, in which every vehicle acts, and `ReplayEnv`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, Categorical, Composite, TensorSpec, Unbounded
from torchrl.envs import EnvBase

from intersection_env.arguments import check_seed
from intersection_env.envs.spaces import observation_space
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.life import fresh_seed
from intersection_env.worlds.replay import ReplayWorlds

AGENTS = "agents"


class _WorldsEnv(EnvBase):  # type: ignore[misc]  # TorchRL is untyped
    """What both share: a core that starts anew by itself, so that a reset only hands out what is there already.

    All that is handed out is a copy, as the core's arrays hold one moment only.
    """

    worlds: ClosedLoopWorlds | ReplayWorlds
    group: str | None
    """The key under which agents are, if they have a dimension of their own."""

    def __init__(self, worlds: ClosedLoopWorlds | ReplayWorlds, desynchronise: bool, low: Tensor, high: Tensor) -> None:
        super().__init__(device="cpu", batch_size=worlds.action.shape[:1])
        self.worlds = worlds
        self.desynchronise = desynchronise
        self._next_seed: int | None = None
        self._restarted = np.zeros(worlds.action.shape, np.bool_)  # in the last step, and not handed out yet
        actors = worlds.action.shape
        self.observation_spec = self._spec(observation=Bounded(low.expand(*actors, -1), high.expand(*actors, -1)))
        self.action_spec = self._spec(action=Bounded(-1.0, 1.0, (*actors, 1), dtype=torch.float32))
        self.reward_spec = self._spec(reward=Unbounded((*actors, 1)))
        flags = {name: Categorical(2, (*actors, 1), dtype=torch.bool) for name in ("done", "terminated", "truncated")}
        self.done_spec = self._spec(**flags)

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything that the worlds' future depends on, as copies."""
        return self.worlds.state()

    def set_state(self, state: dict[str, NDArray[Any]]) -> TensorDictBase:
        """Goes back to a state; returns what `reset` would: the tensordict to go on from.

        Raises:
            TypeError, ValueError: the state is not one of such worlds.
        """
        self.worlds.set_state(state)
        self._next_seed = None
        self._restarted[:] = False
        return self._now()

    def _set_seed(self, seed: int | None) -> None:
        self._next_seed = fresh_seed() if seed is None else check_seed(seed)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        key = "_reset" if self.group is None else (self.group, "_reset")
        asked = None if tensordict is None else tensordict.get(key, None)
        if asked is not None:
            self._restart(asked.squeeze(-1).numpy())
        elif tensordict is not None and "_reset" in tensordict.keys():  # noqa: SIM118, a tensordict holds no keys
            raise ValueError(f'"_reset" is not at the root here, but at {key}, one entry an agent')
        else:
            self._start()
        return self._now()

    def _start(self) -> None:
        if self._next_seed is not None or not self.worlds.is_reset:
            self.worlds.reset(fresh_seed() if self._next_seed is None else self._next_seed, self.desynchronise)
            self._next_seed = None
        else:
            self.worlds.reset_worlds(np.ones(self.batch_size, np.bool_))
        self._restarted[:] = False

    def _restart(self, asked: NDArray[np.bool_]) -> None:
        """Starts worlds anew where someone is asked to who has not just restarted; asked: as `action`."""
        due = (asked & ~self._restarted).reshape(len(asked), -1)
        worlds: NDArray[np.bool_] = np.any(due, axis=1)
        if not asked[worlds].all():
            raise ValueError("a vehicle is asked to restart by itself; vehicles restart together, a world at a time")
        if worlds.any():
            self.worlds.reset_worlds(worlds)
        self._restarted &= ~asked

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        worlds, action = self.worlds, tensordict.get("action" if self.group is None else (self.group, "action"))
        if not bool((action.abs() <= 1.0).all()):
            raise ValueError(f"an action is {action[~(action.abs() <= 1.0)][0].item()}; wanted -1 to 1")
        torch.from_numpy(worlds.action).copy_(action.squeeze(-1))
        worlds.step()
        terminated, truncated = torch.from_numpy(worlds.terminated).clone(), torch.from_numpy(self._truncated())
        done = terminated | truncated
        torch.from_numpy(self._restarted).copy_(done)
        seen, last = torch.from_numpy(worlds.observation), torch.from_numpy(worlds.final_observation)
        return self._data(
            observation=torch.where(done.unsqueeze(-1), last, seen),
            reward=torch.from_numpy(worlds.reward).unsqueeze(-1).clone(),
            done=done.unsqueeze(-1),
            terminated=terminated.unsqueeze(-1),
            truncated=truncated.unsqueeze(-1),
        )

    def _truncated(self) -> NDArray[np.bool_]:
        """Whose return the last step cut without an end, as a copy."""
        return self.worlds.truncated.copy()

    def _now(self) -> TensorDictBase:
        nobody = torch.zeros((*self.worlds.action.shape, 1), dtype=torch.bool)
        return self._data(
            observation=torch.from_numpy(self.worlds.observation).clone(),
            done=nobody,
            terminated=nobody.clone(),
            truncated=nobody.clone(),
        )

    def _data(self, **entries: Tensor) -> TensorDictBase:
        if self.group is None:
            return TensorDict(entries, self.batch_size)
        return TensorDict({self.group: TensorDict(entries, self.worlds.action.shape)}, self.batch_size)

    def _spec(self, **entries: TensorSpec) -> Composite:
        if self.group is None:
            return Composite(entries, shape=self.batch_size)
        return Composite({self.group: Composite(entries, shape=self.worlds.action.shape)}, shape=self.batch_size)


class ClosedLoopEnv(_WorldsEnv):
    """Worlds in which every vehicle acts, as `intersection_env.ClosedLoop` describes them; batch size (world,).

    All keys are under "agents", (world, vehicle): "observation" (12,), "action" (1,), "reward" (1,), and "done",
    "terminated" and "truncated" (1,). There are none at the root, as a vehicle's life ends at its own time: at a
    reinsertion it alone is done and truncated, at the end of its world all are. ("next", "agents", "observation") is
    the last one of the life that ended. The next step of a rollout or a collector begins with the new life's, which
    TorchRL asks for through ("agents", "_reset"); so transforms such as `RewardSum` and `InitTracker` keep to lives.
    `GAE` and losses want the keys ("agents", "reward"), ("agents", "done") and ("agents", "terminated").

    A vehicle that has not just ended restarts only together with its whole world.
    """

    worlds: ClosedLoopWorlds
    group = AGENTS

    def __init__(
        self, map: str | Path | Intersection = "bendplatz", *, desynchronise: bool = False, **arguments: Any
    ) -> None:
        """Worlds on one map.

        Args:
            map: a map's name or file, or the map itself.
            desynchronise: the first reset, and that after each `set_seed`, begins in the midst of episodes.
            arguments: worlds, vehicles, gap, max_cycles, bodies, threads and isa, as of `ClosedLoopWorlds`.
        """
        worlds = ClosedLoopWorlds(map, autoreset="same_step", **arguments)
        fastest = max(float(route.samples[:, Sample.V_MAX].max()) for route in worlds.intersection.routes)
        box = observation_space(worlds.intersection, fastest, backing=True)
        super().__init__(worlds, desynchronise, torch.from_numpy(box.low), torch.from_numpy(box.high))
        self.group_map = {AGENTS: [f"vehicle_{slot}" for slot in range(worlds.action.shape[1])]}

    def _truncated(self) -> NDArray[np.bool_]:
        return self.worlds.truncated | self.worlds.reinserted


class ReplayEnv(_WorldsEnv):
    """Worlds in which one vehicle of a recorded scene acts, as `intersection_env.Replay` has them; batch size (world,).

    Keys at the root: "observation" (12,), "action" (1,), "reward" (1,), "done", "terminated" and "truncated" (1,).
    What the recorded vehicle saw and did at the step that was handed out last is in `worlds.expert_observation` and
    `worlds.expert_acceleration`.
    """

    worlds: ReplayWorlds
    group = None

    def __init__(
        self, scenes: str | Path | Scenes = "bendplatz", *, desynchronise: bool = False, **arguments: Any
    ) -> None:
        """Worlds in the scenes of one file.

        Args:
            scenes: a scenes file's name or path, or the scenes themselves.
            desynchronise: as of `ClosedLoopEnv`.
            arguments: map, split, gap, worlds, bodies, threads and isa, as of `ReplayWorlds`.
        """
        worlds = ReplayWorlds(scenes, autoreset="same_step", **arguments)
        box = observation_space(worlds.intersection, worlds.tracks.fastest, backing=False)
        super().__init__(worlds, desynchronise, torch.from_numpy(box.low), torch.from_numpy(box.high))
