"""Who decides and who drives, by name: policies that ship, rules, and policy files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from intersection_env.arguments import file_there, name_or_file, word
from intersection_env.policies.file import PolicyFile

POLICIES = Path(__file__).parent
"""The folder of those that ship."""
DEFAULT = (POLICIES / "default").read_text(encoding="utf-8").strip()
"""The policy that is loaded where none is named: of those trained that pass the gates, the one that predicts best."""
RULES = ("idm", "constant_velocity")
"""Rules that drive."""
GAP_RULES = ("critical_gap", "sumo")
"""Rules that decide about gaps."""


def shipped_policies() -> tuple[str, ...]:
    """The names of the policies that ship, in order."""
    return tuple(sorted(file.stem for file in POLICIES.glob("*.policy")))


def policy_path(policy: str | Path) -> Path:
    """Where a policy lies: one that ships, by its name, or a policy file (`.policy`).

    Raises:
        TypeError: neither a name nor a path.
        ValueError: no policy of that name.
        FileNotFoundError: no such policy file.
    """
    names = (*shipped_policies(), *RULES)
    path = name_or_file("policy", policy, names)
    if path.suffix == ".policy":
        return file_there("policy", path, names)
    if str(policy) not in shipped_policies():
        raise ValueError(f'no policy "{policy}": the names are {", ".join(names)}, and files end in .policy')
    return POLICIES / f"{policy}.policy"


def policy_named(policy: str | Path, gap: str | None = None) -> tuple[PolicyFile, str]:
    """A policy that ships, a rule that drives, or a policy file; and what to call it.

    Args:
        policy: a name or a path.
        gap: for rules only, who accepts a gap: one of `GAP_RULES`, by default the first.

    Raises:
        TypeError: neither a name nor a path; or a `gap` that is no string.
        ValueError: an unknown name, a policy file that is damaged or made for something else, or a `gap` for a policy
            that brings its own.
        OSError: the file is not there, or cannot be read.
    """
    if str(policy) in RULES:
        if gap == "network":
            raise ValueError(f'"{policy}" has no gap network; gap must be "critical_gap" or "sumo"')
        if gap is not None and word("gap", gap, GAP_RULES) not in GAP_RULES:
            raise ValueError(f'gap is "{gap}"; the rules are {", ".join(GAP_RULES)}')
        return PolicyFile(gap or GAP_RULES[0], str(policy)), str(policy)
    if gap is not None:
        raise ValueError(f'gap belongs to the rules {", ".join(RULES)}; the policy "{policy}" brings its own')
    path = policy_path(policy)
    return PolicyFile.read(path), path.stem


def gap_decider(gap: str | Path) -> PolicyFile:
    """Who decides about gaps: a rule's name, or a policy (name or file) with a gap network, without its forecasts.

    Raises:
        TypeError: neither a name nor a path.
        ValueError: no rule or policy of that name, or a policy without a gap network.
        OSError: the policy file is not there, or cannot be read.
    """
    name_or_file("gap", gap, (*GAP_RULES, *shipped_policies()))
    if str(gap) in GAP_RULES:
        return PolicyFile(str(gap), "idm")
    try:
        policy, _ = policy_named(gap)
    except ValueError as error:
        raise ValueError(f"gap: neither {' nor '.join(GAP_RULES)}, nor a policy: {error}") from None
    if policy.gap != "network":
        raise ValueError(f'gap: the policy "{gap}" has no gap network; the rules are {", ".join(GAP_RULES)}')
    return replace(policy, order_network=None, spread=None)  # who drives by it spreads otherwise
