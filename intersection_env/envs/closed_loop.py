"""Every vehicle acts: `ClosedLoop`, a PettingZoo environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import AssertOutOfBoundsWrapper, OrderEnforcingWrapper

from intersection_env.envs.actions import read_actions
from intersection_env.envs.central_state import central_state, central_state_space
from intersection_env.envs.spaces import action_space, observation_space
from intersection_env.envs.view import FRAMES_PER_SECOND, RENDER_MODES, View
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.life import Bodies, fresh_seed

Array = NDArray[np.float32]
Steps = tuple[dict[str, Array], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]
TRUE = b"\1"
VIEWS = (
    "_step",
    "_action",
    "_reward",
    "_done",
    "_observation",
    "_final_observation",
    "_terminated",
    "_truncated",
    "_reinserted",
)


class ClosedLoop(ParallelEnv[str, Array, Array]):
    r"""Vehicles cross an intersection without traffic lights, and every one of them is an agent.

    ![The closed loop](pictures/closed_loop.png)

    Each agent drives along a random route and decides about its acceleration only. Who has to yield follows from the
    road: the main road goes before the side road, straight ahead before turning left. Whether a vehicle that has to
    yield may enter is decided for it (the gap decision, the last feature); the agent has to stop at the line as long as
    it may not, and to follow the vehicle ahead. This is the environment in which Mertens et al. 2024, *Fast Long-Term
    Multi-Scenario Prediction for Maneuver Planning at Unsignalized Intersections*, train their driving network.

    ```python
    from intersection_env import parallel_env

    env = parallel_env()
    observations, infos = env.reset(seed=42)
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        observations, rewards, terminations, truncations, infos = env.step(actions)
    env.close()
    ```

    `pettingzoo.make("parallel", "intersection_env/ClosedLoop-v0")` makes the same, `env()` or
    `pettingzoo.make("aec", ...)` its turn-based form.

    | agents | `vehicle_0` to `vehicle_11`: fixed slots, 12 by default |
    |---|---|
    | actions | continuous, `Box(-1, 1, (1,), float32)` |
    | observations | `Box(low, high, (12,), float32)` |
    | time step | 0.2 s |

    ## Action

    One number in [-1, 1], times 6 m/s²: the acceleration over the next step, as an array of float32, NumPy's or one
    that NumPy can read, as a torch tensor. A value outside or of another type is refused, not clipped. Braking goes on
    below standstill: a vehicle may back, which costs reward.

    ## Observation

    The twelve features of the paper's Table I, in their units; the bounds are those on Bendplatz, and nothing exceeds
    them.

    | | feature | unit | least | most |
    |---|---|---|---|---|
    | 0 | d_stop, front bumper to the stop line | m | -208.1 | 166.9 |
    | 1 | v, speed | m/s | -64.8 | 64.8 |
    | 2 | v_max, speed limit | m/s | 0 | 14.0 |
    | 3 | the road's heading 10 m behind, relative to that here | rad | -π | π |
    | 4 | 3 m behind | rad | -π | π |
    | 5 | 3 m ahead | rad | -π | π |
    | 6 | 10 m ahead | rad | -π | π |
    | 7 | 30 m ahead | rad | -π | π |
    | 8 | 100 m ahead | rad | -π | π |
    | 9 | d_lead, to the vehicle ahead in the own lane; 100 without one | m | -50 | 100 |
    | 10 | v_lead, its speed; 100 km/h without one | m/s | -64.8 | 64.8 |
    | 11 | delta, 1 if the vehicle may enter, 0 if it has to wait | | 0 | 1 |

    ![What an agent sees](pictures/features.png)

    `state()` is the whole world for central critics, within `state_space`: one row of float32, of each vehicle in turn
    its place x and y [m], heading [rad], length and width [m], then its twelve features.

    ## Reward

    The paper's Table II; a is the acceleration, v the speed, d_stop and d_lead the distances, v_max the speed limit,
    s_brake = max(v, 0)² / (2 · 4 m/s²) the distance in which the vehicle can stop, delta the gap decision.

    | term | is |
    |---|---|
    | base | 2 |
    | acceleration | -0.01 a² |
    | uncomfortable, \|a\| > 2.5 m/s² | -1 |
    | harsh, \|a\| > 4 m/s² | -20 |
    | too slow, v < v_min | -20 (v_min - v) / v_max |
    | too fast, v > v_max | -30 (v - v_max) / v_max |
    | backwards, v < 0 | -30 \|v\| |
    | too close, s_brake > d_lead | -30 (s_brake - d_lead) |
    | running the line, s_brake > d_stop and delta = 0 | -30 (s_brake - d_stop) |
    | to blame for a collision | -5000 |

    v_min = min(v_max, sqrt(2 · 1 m/s² · d)), where d is d_lead, or the smaller of d_lead and d_stop where delta = 0:
    who could go on has to. Two vehicles collide where less than 0.5 m remain between their bodies, now, or if both
    braked with 4 m/s². A body is the paper's two circles by default, which leave the ends of a long vehicle and the
    middle of its sides uncovered; with `bodies="rectangles"` it is a rectangle of the vehicle's length and width.

    ## Start

    Random routes, sizes, positions and speeds, such that nobody violates a constraint: all penalties but those of the
    acceleration are 0, and nobody collides.

    ## Going on, and the end

    A vehicle that leaves the map is reinserted at the begin of a random route, with a random size and speed; its slot
    lives on. `infos[agent]` of that step holds `"reinserted"`, which is true, and `"final_observation"`, the last
    observation of the vehicle that left, with which a learner bootstraps the return that ends there. After all other
    steps it is empty; after a reset it holds both keys too, `"reinserted"` false and the first observation, for
    wrappers that ask the first infos which keys there are.

    The world ends for all agents together:

    - a collision: whoever is to blame for it **terminates** (the one who had to yield, else the one behind), all others
      are **truncated**;
    - a reinsertion for which there is no room, or `max_cycles` steps: all are **truncated**.

    With `ends_together`, whoever terminates is truncated too, so that a world's end truncates all of its agents. That
    is for wrappers that end an episode only where all agents are terminated or all are truncated, as RLlib's, and go on
    stepping a world that has ended otherwise. Nothing else changes: whoever caused a collision still terminates.

    ## Arguments

    | argument | default | meaning |
    |---|---|---|
    | `map` | `"bendplatz"` | a map that ships (`"t_junction"`), a map's file, or an `Intersection` |
    | `vehicles` | 12 | how many agents, 1 to 64, if the map has room for them |
    | `gap` | `"critical_gap"` | who decides about gaps, see below |
    | `max_cycles` | 2000 | steps after which the world ends; a change takes effect with the next reset |
    | `render_mode` | `None` | `"rgb_array"` or `"human"` |
    | `ends_together` | `False` | whether a world's end truncates those who terminate too, see above |
    | `bodies` | `"circles"` | what stands for a vehicle in collisions: `"circles"` or `"rectangles"`, see the reward |

    Gaps are decided by a rule, `"critical_gap"` (6 s where paths cross, 4 s where they merge) or `"sumo"`, or by the
    gap network of a policy: the name of one that ships (`"gap"`) or a `.policy` file.

    `reset(seed, options)`: the same seed gives the same world; without one, the world goes on to its next start.
    Options are ignored. `np_random` is NumPy's generator for wrappers and rewards of one's own, which the seed
    determines too; the world draws from streams in the core.

    ## Versions

    - v0: the first.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012, PettingZoo's convention
        "name": "closed_loop_v0",
        "render_modes": list(RENDER_MODES),
        "render_fps": FRAMES_PER_SECOND,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        map: str | Path | Intersection = "bendplatz",
        vehicles: int = 12,
        gap: str | Path = "critical_gap",
        max_cycles: int = 2000,
        render_mode: str | None = None,
        ends_together: bool = False,
        bodies: Bodies = "circles",
    ) -> None:
        """The environment; the class says what the arguments mean.

        Raises:
            TypeError: `vehicles` or `max_cycles` is no whole number.
            ValueError: an impossible argument.
            OSError: a map's or policy's file cannot be read.
        """
        self.render_mode = render_mode
        self._view = View(render_mode)
        self.max_cycles = max_cycles
        self.ends_together = ends_together
        self.np_random, self.np_random_seed = seeding.np_random()
        self._made_with: dict[str, Any] = {"map": map, "vehicles": vehicles, "gap": gap, "bodies": bodies}
        self._bind(self._worlds_until(max_cycles))
        self._worlds_end = max_cycles
        self.possible_agents = [f"vehicle_{slot}" for slot in range(self._action.shape[0])]
        self._nobody = dict.fromkeys(self.possible_agents, False)
        self.agents: list[str] = []
        intersection = self._worlds.intersection
        fastest = max(float(route.samples[:, Sample.V_MAX].max()) for route in intersection.routes)
        observations = observation_space(intersection, fastest, backing=True)
        self.state_space = central_state_space(intersection, len(self.possible_agents), observations)
        self._observation_spaces = {agent: observations for agent in self.possible_agents}
        self._action_spaces = {agent: action_space() for agent in self.possible_agents}

    def observation_space(self, agent: str) -> Box[np.float32]:
        """The space of an agent's observations, always the same object."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> Box[np.float32]:
        """The space of an agent's actions, always the same object."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Array], dict[str, dict[str, Any]]]:
        """A new start: the one that the seed determines, or the next one.

        Raises:
            TypeError, ValueError: a seed that is no whole number from 0 to 2^63 - 1, or a `max_cycles` that is none
                from 1.
            RuntimeError: there is no room on the map for so many vehicles.
        """
        if self.max_cycles != self._worlds_end:
            self._change_end()
        if seed is None and self._worlds.is_reset:
            self._worlds.reset_worlds(np.ones(1, np.bool_))
        else:
            self._worlds.reset(fresh_seed() if seed is None else seed)
        self.agents = self.possible_agents[:]
        if seed is not None:
            self.np_random, self.np_random_seed = seeding.np_random(int(seed))
        self._view.after_step(self._worlds)
        observations = dict(zip(self.agents, self._observation.copy(), strict=True))
        # Both keys for all: TorchRL asks the first infos which ones there are.
        last = zip(self.agents, self._observation.copy(), strict=True)
        return observations, {agent: {"reinserted": np.False_, "final_observation": row} for agent, row in last}

    def step(self, actions: Mapping[str, Array]) -> Steps:
        """One step of 0.2 s with the actions of all agents.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset, or after the end.
            gymnasium.error.InvalidAction: an agent without an action, an unknown one, or an action that is no float32
                array of shape (1,) in [-1, 1].
        """
        agents = self.agents
        if not agents:
            raise ResetNeeded("there are no agents before the first reset and after the world's end: call reset()")
        read_actions(actions, agents, self._action)
        self._step()
        # From here on every call counts: 12 agents are to be served in 15 microseconds, of which the core takes four.
        rewards = dict(zip(agents, self._reward.tolist()))  # noqa: B905, a keyword costs
        if self._done[0]:
            return self._end(rewards)
        observations = dict(zip(agents, self._observation.copy()))  # noqa: B905
        infos: dict[str, dict[str, Any]] = {agent: {} for agent in agents}
        if TRUE in self._reinserted.tobytes():
            for slot in np.flatnonzero(self._reinserted).tolist():
                last = self._final_observation[slot].copy()
                infos[agents[slot]] = {"reinserted": np.True_, "final_observation": last}
        self._view.after_step(self._worlds)
        return observations, rewards, self._nobody.copy(), self._nobody.copy(), infos

    def state(self) -> Array:
        """The whole world, as the class says; after its end, with what all saw last.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset.
        """
        if not self._worlds.is_reset:
            raise ResetNeeded("there is no state before the first reset: call reset()")
        return central_state(self._worlds, self._observation if self.agents else self._last_observation())

    def render(self) -> NDArray[np.uint8] | None:
        """A picture of the moment (600, 600, 3), or None after it was shown in a window; raises as `View.show`."""
        return self._view.show(self._worlds)

    def close(self) -> None:
        """Closes the window, if there is one."""
        self._view.close()

    def _bind(self, worlds: ClosedLoopWorlds) -> None:
        """Takes hold of the only world's arrays."""
        self._worlds, self._step = worlds, worlds.core.step
        self._action, self._reward, self._done = worlds.action[0], worlds.reward[0], worlds.done
        self._observation, self._final_observation = worlds.observation[0], worlds.final_observation[0]
        self._terminated, self._truncated = worlds.terminated[0], worlds.truncated[0]
        self._reinserted = worlds.reinserted[0]

    def _worlds_until(self, max_cycles: int) -> ClosedLoopWorlds:
        return ClosedLoopWorlds(**self._made_with, max_cycles=max_cycles, autoreset="off")

    def _change_end(self) -> None:
        worlds = self._worlds_until(self.max_cycles)
        if self._worlds.is_reset:
            # Only the random stream matters, as a start follows; the cycle may lie beyond the new end.
            state = self._worlds.state()
            worlds.set_state(state | {"cycle": np.zeros_like(state["cycle"])})
        self._bind(worlds)
        self._worlds_end = self.max_cycles

    def _end(self, rewards: dict[str, float]) -> Steps:
        """What the step that ended the world gives: the last observations of all."""
        agents, self.agents = self.agents, []
        observations = dict(zip(agents, self._last_observation(), strict=True))
        terminations = dict(zip(agents, self._terminated.tolist(), strict=True))
        truncated = self._truncated | self._terminated if self.ends_together else self._truncated
        truncations = dict(zip(agents, truncated.tolist(), strict=True))
        self._view.after_step(self._worlds)
        return observations, rewards, terminations, truncations, {agent: {} for agent in agents}

    def _last_observation(self) -> Array:
        """What all saw when the world ended."""
        cut = self._terminated | self._truncated | self._reinserted
        last: Array = np.where(cut[:, None], self._final_observation, self._observation)
        return last

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in VIEWS}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind(self._worlds)


parallel_env = ClosedLoop
"""The environment as PettingZoo's parallel API has it."""


def env(*arguments: Any, **named_arguments: Any) -> AECEnv[str, Array, Array | None]:
    """The environment as PettingZoo's turn-based API (AEC) has it; arguments as of `ClosedLoop`."""
    parallel: ParallelEnv[str, Array, Any] = ClosedLoop(*arguments, **named_arguments)
    turns = parallel_to_aec_wrapper(parallel)
    return OrderEnforcingWrapper(AssertOutOfBoundsWrapper(turns))
