"""Many replays at once, in the core: `ReplayVector`, which `gymnasium.make_vec` makes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from intersection_env.arguments import whole_number
from intersection_env.constants import DT
from intersection_env.envs.actions import check_actions
from intersection_env.envs.spaces import action_space, observation_space
from intersection_env.envs.spec import by_name
from intersection_env.envs.view import FRAMES_PER_SECOND, View
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.life import Autoreset, Bodies, fresh_seed
from intersection_env.worlds.replay import ReplayWorlds

Array = NDArray[Any]
TRUE = b"\1"
Steps = tuple[Array, Array, Array, Array, dict[str, Any]]


class ReplayVector(VectorEnv[Array, Array, Array]):
    """Many worlds of `Replay`, stepped at once by the core.

    ```python
    import gymnasium

    envs = gymnasium.make_vec("intersection_env/Replay-v0", num_envs=64)
    ```

    World i of `reset(seed=s)` starts with the random stream of (s, i); world 0 is `Replay` with that seed. Of a list of
    seeds, world i is `Replay` with the i-th; where that is None, its stream goes on. Infos are those of `Replay`, each
    an array over the worlds; `envs.unwrapped.names(infos)` lists the ids of scenes and vehicles.

    | argument | default | meaning |
    |---|---|---|
    | `num_envs` | 1 | how many worlds |
    | `scenes`, `map`, `split`, `gap`, `bodies` | | as in `Replay` |
    | `autoreset_mode` | `"NextStep"` | an `AutoresetMode` or its value, see below |
    | `threads` | 1 | how many step the worlds, 0: one a core; they do not change what happens |
    | `render_mode` | `None` | `"rgb_array"` |
    | `max_episode_steps` | `None` | steps after which an episode is truncated, as by Gymnasium's `TimeLimit` |

    - `"NextStep"`: a world whose episode has ended starts anew with the next step, which ignores its action and gives
      it a reward of 0.
    - `"SameStep"`: it starts anew at once; `infos["final_obs"]` and `infos["final_info"]` hold the end.
    - `"Disabled"`: it must be started anew with `reset(options={"reset_mask": mask})` before the next step.
    """

    _spec: EnvSpec | None = None
    metadata: dict[str, Any] = {  # noqa: RUF012, Gymnasium's convention
        "render_modes": ["rgb_array"],
        "render_fps": FRAMES_PER_SECOND,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        scenes: str | Path | Scenes = "bendplatz",
        split: str | None = "train",
        gap: str | Path = "recording",
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        map: str | Path | Intersection | None = None,
        bodies: Bodies = "circles",
    ) -> None:
        """The environment; the class says what the arguments mean.

        Raises:
            TypeError: a count that is no whole number.
            ValueError: an impossible argument, or a scenes file that is damaged or of another map or version.
            OSError: a file cannot be read.
        """
        self._view = View(render_mode, ("rgb_array",))
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.num_envs = num_envs = whole_number("num_envs", num_envs)
        if max_episode_steps is not None and whole_number("max_episode_steps", max_episode_steps) < 1:
            raise ValueError(f"max_episode_steps is {max_episode_steps}; wanted 1 or more, or None")
        self._limit = max_episode_steps
        self._elapsed = np.zeros(num_envs, np.int64)
        self._cut = np.zeros(num_envs, np.bool_)
        """Where the last step reached the limit, of which the core knows nothing, and the next one starts anew."""
        # "SameStep" is made from "off" and a reset, since the core's own would overwrite the final info.
        autoreset: Autoreset = "next_step" if self.autoreset_mode is AutoresetMode.NEXT_STEP else "off"
        self._worlds = ReplayWorlds(
            scenes,
            map=map,
            split=split,
            gap=gap,
            worlds=num_envs,
            bodies=bodies,
            autoreset=autoreset,
            threads=threads,
        )
        tracks = self._worlds.tracks
        self._seconds = np.round(np.arange(int(tracks.arrays["scene_steps"].max()) + 1) * DT, 1).astype(np.float32)
        self._all = np.ones(num_envs, np.bool_)
        is_disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._waiting = np.zeros(num_envs, np.bool_) if is_disabled else None
        """Which ended episodes wait for their reset, with autoreset disabled."""
        self.single_action_space = action_space()
        self.single_observation_space = observation_space(self._worlds.intersection, tracks.fastest, backing=False)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    @property  # of Gymnasium an attribute, which `make` sets
    def spec(self) -> EnvSpec | None:
        """What it was made with, by names where there are some."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = by_name(spec)

    @property
    def scenes(self) -> Scenes:
        """The scenes that are replayed."""
        return self._worlds.tracks.scenes

    def names(self, infos: Mapping[str, Any]) -> list[tuple[str, str]]:
        """Of each world the ids of scene and acting vehicle, of what `reset` or `step` gave as infos for all worlds."""
        return [self._worlds.tracks.names(*one) for one in zip(infos["scene"], infos["vehicle"], strict=True)]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """New episodes in all worlds, or in those where option `reset_mask`, (num_envs,) bool, is true.

        Raises:
            TypeError, ValueError: an unknown option, no such mask, or not one seed a world where there are several.
        """
        mask = self._mask(options or {})
        worlds = self._worlds
        if not worlds.is_reset and not mask.all():
            raise ResetNeeded("the first reset must start all worlds; there is a reset_mask")
        if isinstance(seed, Sequence | np.ndarray):
            self._reset_each(list(seed), mask)
        elif seed is None and worlds.is_reset:
            worlds.reset_worlds(mask)
        else:
            self._reset_all(fresh_seed() if seed is None else seed, mask)
            super().reset(seed=seed)
        if self._waiting is not None:
            self._waiting &= ~mask
        self._elapsed[mask] = 0
        self._cut[mask] = False
        infos: dict[str, Any] = {}
        self._add_infos(infos, self._all if mask.all() else mask)
        return worlds.observation.copy(), infos

    def step(self, actions: Array) -> Steps:
        """One step of 0.2 s in all worlds; actions (num_envs, 1).

        Raises:
            gymnasium.error.ResetNeeded: before the first reset; with autoreset disabled, while an episode has ended.
            gymnasium.error.InvalidAction: no float32 array of shape (num_envs, 1) in [-1, 1].
        """
        worlds = self._worlds
        if not worlds.is_reset:
            raise ResetNeeded("there are no episodes before the first reset: call reset()")
        if self._waiting is not None and self._waiting.any():
            raise ResetNeeded('an episode has ended, autoreset is disabled: call reset(options={"reset_mask": ...})')
        worlds.action[:] = check_actions(actions, (self.num_envs, 1))[:, 0]
        worlds.core.step()
        reward = worlds.reward.astype(np.float64)
        terminated, truncated = worlds.terminated.copy(), worlds.truncated.copy()
        if self._limit is not None:
            self._keep_limit(self._limit, reward, terminated, truncated)
        observation = worlds.observation.copy()
        done = terminated | truncated
        infos: dict[str, Any] = {}
        if TRUE in done.tobytes():
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                infos = self._final_infos(observation, done)
                worlds.reset_worlds(done)
                observation = worlds.observation.copy()
            if self._waiting is not None:
                self._waiting |= done
        self._add_infos(infos, self._all)
        return observation, reward, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture of each world (600, 600, 3); raises as `View.show`."""
        pictures = [self._view.show(self._worlds, world) for world in range(self.num_envs if self.render_mode else 1)]
        return tuple(picture for picture in pictures if picture is not None) or None

    def _reset_all(self, seed: int, mask: NDArray[np.bool_]) -> None:
        """World i of the mask by the random stream of (seed, i)."""
        worlds = self._worlds
        before = None if mask.all() else worlds.state()
        worlds.reset(seed)
        if before is not None:
            seeded = worlds.state()
            for name, values in seeded.items():
                values[~mask] = before[name][~mask]
            worlds.set_state(seeded)

    def _reset_each(self, seeds: list[int | None], mask: NDArray[np.bool_]) -> None:
        """World i of the mask as `Replay` does with the i-th seed."""
        self._worlds.reset_each(seeds, mask)
        given = [seed for seed in seeds if seed is not None]
        if given:
            self.np_random = np.random.default_rng(given)

    def _keep_limit(self, limit: int, reward: Array, terminated: Array, truncated: Array) -> None:
        """Starts anew what the limit cut one step ago, and cuts what has reached it now; changes the arrays given."""
        if self._cut.any():
            self._worlds.reset_worlds(self._cut)
            reward[self._cut], terminated[self._cut], truncated[self._cut] = 0.0, False, False
        self._elapsed += 1
        reached = self._elapsed >= limit
        is_next = self.autoreset_mode is AutoresetMode.NEXT_STEP
        self._cut = reached & ~(terminated | truncated) & is_next
        truncated |= reached
        self._elapsed[terminated | truncated] = -1 if is_next else 0  # the restart by the next step counts to 0

    def _mask(self, options: dict[str, Any]) -> NDArray[np.bool_]:
        unknown = [name for name in options if name != "reset_mask"]
        if unknown:
            raise ValueError(f'unknown option "{unknown[0]}"; the only one is "reset_mask"')
        mask = options.get("reset_mask", self._all)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f'option "reset_mask" must be a numpy array of bool, not {getattr(mask, "dtype", mask)}')
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f'option "reset_mask" must have shape ({self.num_envs},) and at least one True; {mask}')
        return np.ascontiguousarray(mask)

    def _add_infos(self, infos: dict[str, Any], mask: NDArray[np.bool_]) -> None:
        """The infos of the worlds in the mask, as Gymnasium batches them; the others' are 0."""
        worlds = self._worlds
        chosen = slice(None) if mask is self._all else np.flatnonzero(mask)
        track = worlds.track[chosen]
        added: dict[str, Array] = {
            "expert_observation": np.array(worlds.expert_observation[chosen]),
            "expert_acceleration": np.array(worlds.expert_acceleration[chosen]),
            "scene": worlds.tracks.scene_number.take(track),
            "vehicle": worlds.tracks.track_number.take(track),
            "time": self._seconds.take(worlds.time[chosen]),
        }
        given = mask.copy()
        for name, values in added.items():
            infos[name], infos[f"_{name}"] = self._among_all(values, chosen), given

    def _among_all(self, values: Array, chosen: slice | NDArray[np.intp]) -> Array:
        if isinstance(chosen, slice):
            return values
        among = np.zeros((self.num_envs, *values.shape[1:]), values.dtype)
        among[chosen] = values
        return among

    def _final_infos(self, observation: Array, done: NDArray[np.bool_]) -> dict[str, Any]:
        final = np.full(self.num_envs, None, object)
        for world in np.flatnonzero(done).tolist():
            final[world] = observation[world].copy()
        last: dict[str, Any] = {}
        self._add_infos(last, done)
        return {"final_obs": final, "_final_obs": done.copy(), "final_info": last, "_final_info": done.copy()}

    def close_extras(self, **kwargs: Any) -> None:
        """Lets go of the renderer."""
        self._view.close()
