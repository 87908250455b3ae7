"""Makes docs/environments.md from the environments' docstrings, and its pictures from the environments themselves.

python -m experiments.documentation.environments (part of `make pages`)

Both environments' docstrings tell of the reward, as each is a manual of its own; the page does so once.
"""

from __future__ import annotations

import argparse
import inspect
import re
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from experiments.documentation.features import figure
from experiments.documentation.learning import learning_section
from experiments.documentation.results import ROOT
from intersection_env import ClosedLoop, ClosedLoopWorlds, Replay, ReplayVector, ReplayWorlds, parallel_env
from intersection_env.command import run_command
from intersection_env.files import written_whole
from intersection_env.plots.files import write_figure
from intersection_env.worlds import life as worlds

PAGE = ROOT / "docs" / "environments.md"
PICTURES = ROOT / "docs" / "pictures"
CLOSED_LOOP_SEED = 2  # worlds in which something is to be seen
REPLAY_SEED, REPLAY_STEPS = 43, 18
HEAD = """# Environments

Made from the docstrings by `make pages`; `help(intersection_env.ClosedLoop)` says the same.

| | [ClosedLoop](#closedloop) | [Replay](#replay) |
|---|---|---|
| who acts | every vehicle | one vehicle of a recording |
| interface | PettingZoo: `parallel_env()`, `env()` | Gymnasium: `make`, `make_vec` |
| id | `intersection_env/ClosedLoop-v0` | `intersection_env/Replay-v0` |
| in batches | [ClosedLoopWorlds](#closedloopworlds) | [ReplayVector](#replayvector), [ReplayWorlds](#replayworlds) |
| in TorchRL, from a checkout | `agents.rollouts.envs.ClosedLoopEnv` | `agents.rollouts.envs.ReplayEnv` |
| variants, baselines | [with an id](#environments-with-an-id) | [with an id](#environments-with-an-id) |

[Your own reward or observation](#a-reward-or-an-observation-of-your-own);
[Stable-Baselines3, TorchRL, RLlib and others](#with-a-library).

Both pay [the same reward](#the-reward). What a network sees, who leads, who accepts a gap and what a step does are the
same functions of the core in the predictor, in the closed loop and in the replay. From a checkout, `agents/rollouts/`
runs whole rollouts with policy and value network inside the core.
"""
REWARD = re.compile(
    r"(?<=^### Reward\n\n)The paper's Table II;.*?the vehicle's length and width\.", re.DOTALL | re.MULTILINE
)
SAME_REWARD = "[The same](#the-reward) in both environments."
BATCH = """```python
from intersection_env import ClosedLoopWorlds

worlds = ClosedLoopWorlds(worlds=1024, vehicles=12, threads=2)
worlds.reset(seed=42, desynchronise=True)
for _ in range(100):
    worlds.action[:] = 0.0  # (1024, 12)
    worlds.step()
    worlds.observation, worlds.reward, worlds.terminated, worlds.truncated, worlds.reinserted
```"""


def page() -> str:
    """The page's text."""
    manuals = {
        kind: re.sub("^##", "###", _text(kind), flags=re.MULTILINE) for kind in (ClosedLoop, Replay, ReplayVector)
    }
    reward = _reward(manuals[ClosedLoop], manuals[Replay])
    parts = [HEAD]
    for kind, manual in manuals.items():
        parts.append(f"## {kind.__name__}\n\n{manual.replace(reward, SAME_REWARD)}\n")
    parts.append(f"## The reward\n\n{reward}\n")
    parts.append(f"## Batched worlds\n\n{_text(worlds)}\n\n{BATCH}\n")
    for batched in (ClosedLoopWorlds, ReplayWorlds):
        parts.append(f"### {batched.__name__}\n\n{_attributes(_text(batched))}\n")
    parts.append(learning_section())
    return "\n".join(parts)


def _reward(*manuals: str) -> str:
    """What the manuals say of the reward.

    Raises:
        ValueError: they do not say the same.
    """
    found = {match[0] if (match := REWARD.search(manual)) else None for manual in manuals}
    (reward, *others) = found
    if reward is None or others:
        raise ValueError("the environments' docstrings must say the same of the reward, under the heading Reward")
    return reward


def draw() -> None:
    """Draws the page's pictures."""
    _save("closed_loop", closed_loop_picture())
    _save("replay", replay_picture())
    write_figure(figure(), PICTURES / "features.png")


def closed_loop_picture() -> NDArray[np.uint8]:
    """A moment of the closed loop."""
    environment = parallel_env(render_mode="rgb_array")
    environment.reset(seed=CLOSED_LOOP_SEED)
    picture = environment.render()
    assert picture is not None
    return picture


def replay_picture() -> NDArray[np.uint8]:
    """A moment of a replay in which the acting vehicle lags behind its recorded self."""
    environment: Any = gymnasium.make("intersection_env/Replay-v0", render_mode="rgb_array")
    environment.reset(seed=REPLAY_SEED)
    for _ in range(REPLAY_STEPS):
        environment.step(np.array([-0.15], np.float32))
    return np.asarray(environment.render())


def _text(thing: object) -> str:
    return inspect.getdoc(thing) or ""


def _attributes(text: str) -> str:
    """A docstring's `Attributes:` as a list in Markdown."""
    head, _, rest = text.partition("Attributes:\n")
    lines = [re.sub(r"^    (\S[^:]*):", r"- `\1`:", line) for line in rest.splitlines()]
    return head + "\n".join(re.sub(r"^        ", "  ", line) for line in lines)


def _save(name: str, picture: NDArray[np.uint8]) -> None:
    with written_whole(PICTURES / f"{name}.png") as temporary:
        Image.fromarray(picture).save(temporary, format="png", optimize=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes docs/environments.md and its pictures."""
    argparse.ArgumentParser(
        prog="python -m experiments.documentation.environments", description=main.__doc__
    ).parse_args(arguments)
    draw()
    with written_whole(PAGE) as temporary:
        temporary.write_text(page(), encoding="utf-8")
    print(f"written: {PAGE}")


if __name__ == "__main__":
    run_command(main)
