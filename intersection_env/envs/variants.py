"""The environments that have an id: both by default, and others on other maps, by other rules, or shorter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

import gymnasium
import pettingzoo
from gymnasium.error import Error

NAMESPACE = "intersection_env"
CLOSED_LOOP, REPLAY = "ClosedLoop", "Replay"


@dataclass(frozen=True)
class Variant:
    """An environment with an id, and the arguments that it is made with."""

    name: str
    """The id without its namespace, as `Replay-v0`."""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """Of `ClosedLoop` or `Replay`; what stands here and not in the arguments of `make` holds."""
    max_episode_steps: int | None = None
    """After which an episode is truncated: Gymnasium's `TimeLimit`, in the closed loop its `max_cycles`."""

    @property
    def id(self) -> str:
        """What `gymnasium.make` or `pettingzoo.make` is given."""
        return f"{NAMESPACE}/{self.name}"

    @property
    def kind(self) -> str:
        """`"ClosedLoop"`, which is PettingZoo's, or `"Replay"`, which is Gymnasium's."""
        return CLOSED_LOOP if self.name.startswith(CLOSED_LOOP) else REPLAY


VARIANTS = (
    Variant("ClosedLoop-v0"),
    Variant("ClosedLoopTJunction-v0", {"map": "t_junction"}),
    Variant("ClosedLoopCrossroads-v0", {"map": "crossroads"}),
    Variant("ClosedLoopGapNetwork-v0", {"gap": "gap"}),
    Variant("ClosedLoopFew-v0", {"vehicles": 4}),
    Variant("ClosedLoopMany-v0", {"vehicles": 24}),
    Variant("ClosedLoopShort-v0", max_episode_steps=100),
    Variant("Replay-v0"),
    Variant("ReplayTJunction-v0", {"scenes": "t_junction"}),
    Variant("ReplayCrossroads-v0", {"scenes": "crossroads"}),
    Variant("ReplayCriticalGap-v0", {"gap": "critical_gap"}),
    Variant("ReplayGapNetwork-v0", {"gap": "gap"}),
    Variant("ReplayShort-v0", max_episode_steps=50),
)
"""All that `register` registers. The short ones last 20 s and, as predictions do, 10 s."""


def register() -> None:
    """Makes the environments known to Gymnasium and PettingZoo, and Gymnasium able to say where the others are."""
    for variant in VARIANTS:
        if variant.kind == REPLAY:
            gymnasium.register(
                variant.id,
                entry_point="intersection_env.envs.replay:Replay",
                vector_entry_point="intersection_env.envs.replay_vector:ReplayVector",
                kwargs=dict(variant.arguments),
                max_episode_steps=variant.max_episode_steps,
            )
        else:
            arguments, most = dict(variant.arguments), variant.max_episode_steps
            doors = "intersection_env.envs.closed_loop"
            pettingzoo.register("parallel", variant.id, f"{doors}:parallel_env", kwargs=arguments, max_cycles=most)
            pettingzoo.register("aec", variant.id, f"{doors}:env", kwargs=arguments, max_cycles=most)
            here = f"{__name__}:is_multi_agent"
            gymnasium.register(variant.id, entry_point=here, vector_entry_point=here)


def is_multi_agent(**_: Any) -> NoReturn:
    """What Gymnasium makes of a closed loop.

    Raises:
        gymnasium.error.Error: always.
    """
    raise Error(
        "the closed loop has many agents, which Gymnasium does not know: it is PettingZoo's,"
        ' pettingzoo.make("parallel", "intersection_env/ClosedLoop-v0") or intersection_env.parallel_env()'
        ' (turn by turn: "aec", env(); batched: intersection_env.ClosedLoopWorlds);'
        " with one agent there is intersection_env/Replay-v0"
    )
