"""One vehicle acts among recorded ones: `Replay`, a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from intersection_env.constants import DT
from intersection_env.envs.actions import check_actions
from intersection_env.envs.spaces import action_space, observation_space
from intersection_env.envs.spec import by_name
from intersection_env.envs.view import FRAMES_PER_SECOND, RENDER_MODES, View
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.life import Bodies, fresh_seed
from intersection_env.worlds.replay import ReplayWorlds

Array = NDArray[np.float32]
OPTIONS = ("scene", "vehicle")


class Replay(gymnasium.Env[Array, Array]):
    r"""One vehicle of recorded traffic is driven by the agent; all others do what they did.

    ![The replay](pictures/replay.png)

    A scene is a stretch of recorded traffic at an intersection without traffic lights. One of its vehicles is taken
    out of the recording and acts from where it was first recorded; the others follow the recording, may enter and
    leave, and do not react. What the recorded vehicle saw and did at the same step comes along as `info`, for
    imitation.

    ```python
    import gymnasium
    import intersection_env

    env = gymnasium.make("intersection_env/Replay-v0")
    observation, info = env.reset(seed=42)
    episode_over = False
    while not episode_over:
        action = env.action_space.sample()
        observation, reward, terminated, truncated, info = env.step(action)
        episode_over = terminated or truncated
    env.close()
    ```

    `gymnasium.make("intersection_env:intersection_env/Replay-v0")` spares the import; `gymnasium.make_vec` makes
    `ReplayVector`, many worlds in one.

    | action | continuous, `Box(-1, 1, (1,), float32)` |
    |---|---|
    | observation | `Box(low, high, (12,), float32)` |
    | time step | 0.2 s |

    The scenes that ship are **simulated** with SUMO, in inD's format; `python -m data.build` makes scenes of one's own
    copy of inD.

    ## Action

    One number in [-1, 1], times 6 m/s²: the acceleration over the next step, as an array of float32, NumPy's or one
    that NumPy can read, as a torch tensor. A value outside or of another type is refused, not clipped. Braking ends at
    standstill.

    ## Observation

    The twelve features of the paper's Table I, in their units; the bounds are those of the scenes that ship (training
    split), and nothing exceeds them.

    | | feature | unit | least | most |
    |---|---|---|---|---|
    | 0 | d_stop, front bumper to the stop line | m | -208.2 | 153.8 |
    | 1 | v, speed | m/s | 0 | 65.7 |
    | 2 | v_max, speed limit | m/s | 0 | 14.0 |
    | 3 | the road's heading 10 m behind, relative to that here | rad | -π | π |
    | 4 | 3 m behind | rad | -π | π |
    | 5 | 3 m ahead | rad | -π | π |
    | 6 | 10 m ahead | rad | -π | π |
    | 7 | 30 m ahead | rad | -π | π |
    | 8 | 100 m ahead | rad | -π | π |
    | 9 | d_lead, to the vehicle ahead in the own lane; 100 without one | m | -50 | 100 |
    | 10 | v_lead, its speed; 100 km/h without one | m/s | 0 | 65.7 |
    | 11 | delta, 1 if the vehicle may enter, 0 if it has to wait | | 0 | 1 |

    ![What an agent sees](pictures/features.png)

    The vehicle ahead is the one that was ahead in the recording: whoever was behind the acting vehicle never becomes
    its lead, even if it drives through it. By default delta is what happened: 1 if the recorded vehicle entered before
    those it had to yield to.

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
    middle of its sides uncovered; with `bodies="rectangles"` it is a rectangle of the vehicle's length and width. With
    recorded decisions, the one to blame is the one that went second in the recording; whoever follows the acting
    vehicle is no concern of its.

    ## Info

    | key | type | is |
    |---|---|---|
    | `expert_observation` | (12,) float32 | what the recorded vehicle saw at this step |
    | `expert_acceleration` | float32 | what takes it to its next recorded speed [m/s²]: 6 times its action |
    | `scene` | int64 | the scene's number |
    | `vehicle` | int64 | the acting vehicle's number in its scene |
    | `time` | float32 | since the scene's begin [s] |

    All are NumPy's, so that readers of infos, as TorchRL's, make arrays of them. `env.unwrapped.names(info)` says the
    ids of scene and vehicle; ids and numbers alike are options of `reset`.

    ## Start

    A random car or truck that was recorded for 1 s or more, at its first recorded step. `reset(options={"scene": ...,
    "vehicle": ...})` picks one, by ids or by numbers; with a scene alone, one of its vehicles is drawn; bicycles act
    only if named.

    ## The end

    - a collision that the acting vehicle is to blame for **terminates** the episode;
    - it is **truncated** when the acting vehicle leaves the map, and when the recording of it or of the scene ends.

    ## Arguments

    | argument | default | meaning |
    |---|---|---|
    | `scenes` | `"bendplatz"` | scenes that ship, a scenes file's path, or `Scenes` |
    | `map` | `None` | the map of scenes on a map of one's own: its `.json` or `.map`, or an `Intersection` |
    | `split` | `"train"` | `"train"`, `"development"`, `"validation"`, or `None` for all |
    | `gap` | `"recording"` | who decides about gaps, see below |
    | `render_mode` | `None` | `"rgb_array"` or `"human"` |
    | `bodies` | `"circles"` | what stands for a vehicle in collisions: `"circles"` or `"rectangles"`, see the reward |

    Gaps are decided as in the `"recording"`, by a rule, `"critical_gap"` (6 s where paths cross, 4 s where they merge)
    or `"sumo"`, or by the gap network of a policy: the name of one that ships (`"gap"`) or a `.policy` file.

    ## Versions

    - v0: the first.
    """

    _spec: EnvSpec | None = None
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FRAMES_PER_SECOND}  # noqa: RUF012, Gymnasium's convention

    def __init__(
        self,
        scenes: str | Path | Scenes = "bendplatz",
        split: str | None = "train",
        gap: str | Path = "recording",
        render_mode: str | None = None,
        map: str | Path | Intersection | None = None,
        bodies: Bodies = "circles",
    ) -> None:
        """The environment; the class says what the arguments mean.

        Raises:
            ValueError: an impossible argument, or a scenes file that is damaged or of another map or version.
            OSError: a file cannot be read.
        """
        self.render_mode = render_mode
        self._view = View(render_mode)
        self._worlds = ReplayWorlds(scenes, map=map, split=split, gap=gap, bodies=bodies, autoreset="off")
        self._is_over = True
        self.action_space = action_space()
        self.observation_space = observation_space(
            self._worlds.intersection, self._worlds.tracks.fastest, backing=False
        )

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

    def names(self, info: Mapping[str, Any]) -> tuple[str, str]:
        """The ids of scene and acting vehicle, of what `reset` or `step` gave as info."""
        return self._worlds.tracks.names(info["scene"], info["vehicle"])

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """A new episode: the one that the seed determines, that the options name, or else the next one.

        Raises:
            ValueError: an option other than `scene` and `vehicle`, one that names nothing here, or a vehicle that
                cannot act.
        """
        super().reset(seed=seed)
        track = self._chosen(options) if options else None
        worlds = self._worlds
        if seed is not None or not worlds.is_reset:
            worlds.reset(fresh_seed() if seed is None else seed)
        elif track is None:
            worlds.reset_worlds(np.ones(1, np.bool_))
        if track is not None:
            worlds.start(0, track)
        self._is_over = False
        self._view.after_step(self._worlds)
        return worlds.observation[0].copy(), self._info()

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """One step of 0.2 s with this action.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset, or after the episode's end.
            gymnasium.error.InvalidAction: no float32 array of shape (1,) in [-1, 1].
        """
        if self._is_over:
            raise ResetNeeded("there is no episode before the first reset and after an episode's end: call reset()")
        worlds = self._worlds
        worlds.action[:] = check_actions(action, (1,))
        worlds.step()
        terminated, truncated = bool(worlds.terminated[0]), bool(worlds.truncated[0])
        self._is_over = terminated or truncated
        self._view.after_step(self._worlds)
        return worlds.observation[0].copy(), float(worlds.reward[0]), terminated, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """A picture of the moment (600, 600, 3), or None after it was shown in a window; raises as `View.show`."""
        return self._view.show(self._worlds)

    def close(self) -> None:
        """Closes the window, if there is one."""
        self._view.close()

    def _chosen(self, options: dict[str, Any]) -> int:
        unknown = [name for name in options if name not in OPTIONS]
        if unknown:
            raise ValueError(f'unknown option "{unknown[0]}"; the options are {" and ".join(OPTIONS)}')
        return self._worlds.tracks.choose(options, self.np_random)

    def _info(self) -> dict[str, Any]:
        worlds = self._worlds
        track = worlds.track[0]
        return {
            "expert_observation": worlds.expert_observation[0].copy(),
            "expert_acceleration": worlds.expert_acceleration[0],
            "scene": worlds.tracks.scene_number[track],
            "vehicle": worlds.tracks.track_number[track],
            "time": np.float32(round(int(worlds.time[0]) * DT, 1)),
        }
