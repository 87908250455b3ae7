"""The part of docs/environments.md that is about learning: variants, baseline returns, wrappers, libraries.

The prose stands in `learning_page.md` beside this file, with {{name}} where a table goes.
"""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

from experiments.documentation.results import RESULTS, ROOT, with_tables
from experiments.show.environment_returns import returns_table
from experiments.show.tables import markdown_table
from intersection_env import VARIANTS, Variant

TEMPLATE = Path(__file__).with_name("learning_page.md")
EXAMPLES = ROOT / "examples" / "learning"
LIBRARIES = {
    "sb3_ppo": "Stable-Baselines3",
    "single_file_ppo": "none, in the way of CleanRL",
    "torchrl_ppo": "TorchRL",
    "rllib_ppo": "RLlib, one agent",
    "rllib_multi_agent_ppo": "RLlib, twelve agents",
    "tianshou_ppo": "Tianshou",
    "minari_cloning": "Minari, a data set of the recorded drivers",
}
"""The examples, in the order of the page."""


def learning_section() -> str:
    """The part of the page.

    Raises:
        OSError: there is no results file, or an example is missing.
        ValueError: the template names another table than those there are.
    """
    results = json.loads((RESULTS / "returns.json").read_text(encoding="utf-8"))
    tables = {
        "variants": variants_table(),
        "returns": returns_table(results),
        "counts": f"{results['worlds']} episodes of the closed loop, {results['episodes']} of the replay",
        "examples": examples_table(),
    }
    return with_tables(TEMPLATE.read_text(encoding="utf-8"), tables)


def variants_table() -> str:
    """A line an environment: what it is made with."""
    return markdown_table(("id", "made with"), [(f"`{one.id}`", _made_with(one)) for one in VARIANTS])


def examples_table() -> str:
    """A line an example: library, file, and how it is installed and run, as the file says itself."""
    rows = [
        (library, f"[{name}.py](../examples/learning/{name}.py)", _how(name)) for name, library in LIBRARIES.items()
    ]
    return markdown_table(("library", "file", "how"), rows)


def _made_with(variant: Variant) -> str:
    given = [f"`{name}={value!r}`" for name, value in variant.arguments.items()]
    if variant.max_episode_steps is not None:
        limit = "max_cycles" if variant.kind == "ClosedLoop" else "max_episode_steps"
        given.append(f"`{limit}={variant.max_episode_steps}`")
    return ", ".join(given) or "the defaults"


def _how(name: str) -> str:
    """The commands in an example's docstring: its second paragraph."""
    docstring = ast.get_docstring(ast.parse((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))) or ""
    _, commands, *_ = re.split(r"\n\n", docstring)
    return "<br>".join(f"`{line}`" for line in commands.splitlines())
