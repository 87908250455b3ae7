"""The tables of docs/results.md, as Markdown, each from the content of a results file."""

from __future__ import annotations

from typing import Any

import pandas as pd

from experiments.report.headlines import headlines

HORIZONS = (2.0, 4.0, 6.0, 8.0, 10.0)
MODELS = {
    "constant_velocity": "constant velocity",
    "idm": "critical gaps, IDM",
    "gap": "gap network, IDM",
    "idm_calibrated": "gap network, calibrated IDM",
    "ppo": "gap network, PPO",
    "gail": "gap network, GAIL",
}

SPEED_ROWS = (
    ("1 scenario", "single_us", "networks", None),
    ("64", "batch_us", "networks", "64"),
    ("1024", "batch_us", "networks", "1024"),
    ("1024, {cores} cores", "threads_us", "networks", "1024"),
    ("1024, with smallest distances", "batch_us", "networks, with distances", "1024"),
    ("all priorities assigned, 64", "assigned_us", "assigned", "64"),
    ("all priorities assigned, 1024", "assigned_us", "assigned", "1024"),
    ("rules and IDM instead of networks, 1", "single_us", "idm", None),
    ("rules and IDM instead of networks, 1024", "batch_us", "idm", "1024"),
)
"""Name (`cores`: the machine's), table, row and number of scenarios."""
CYCLE_ROWS = {"maneuvers in 200 ms": "networks", "the same, all priorities assigned": "assigned"}


def errors_table(errors: pd.DataFrame) -> str:
    """Markdown of the errors over the horizon, vehicles recorded at the start and at the horizon."""
    recorded = errors[errors["population"] == "recorded"].set_index(["model", "horizon"]).to_dict("index")
    heads = [f"{horizon:.0f} s" for horizon in HORIZONS]
    lines = [f"| RMSE / MAD [m], time loss RMSE [s] | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for model, name in MODELS.items():
        rows = [recorded[model, horizon] for horizon in HORIZONS]
        cells = [f"{row['rmse']:.1f} / {row['mad']:.1f}, {row['time_loss_rmse']:.1f}" for row in rows]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    counts = [f"{recorded[next(iter(MODELS)), horizon]['count']:.0f}" for horizon in HORIZONS]
    lines.append(f"| samples | {' | '.join(counts)} |")
    return "\n".join(lines)


def speed_table(bench: dict[str, Any]) -> str:
    """Markdown of microseconds a scenario by kernel, of their ratios to the floor, and of maneuvers a cycle."""
    lines = ["| µs a scenario: median (best; best to floor) | " + " | ".join(bench["floor_us"]) + " |"]
    lines.append("|---" * (len(bench["floor_us"]) + 1) + "|")
    lines.append("| floor; all assigned | " + " | ".join(_floors(bench, isa) for isa in bench["floor_us"]) + " |")
    for name, table, row, scenarios in SPEED_ROWS:
        cells = []
        for isa, floor in bench["assigned_floor_us" if table == "assigned_us" else "floor_us"].items():
            found = bench[table][isa][row]
            found = found if scenarios is None else found[scenarios]
            ratio = "" if row.startswith("idm") else f"; {found['best'] / floor:.2f}"
            cells.append(f"{found['median']:.1f} ({found['best']:.1f}{ratio})")
        lines.append(f"| {name.format(cores=bench['cores'])} | {' | '.join(cells)} |")
    for name, row in CYCLE_ROWS.items():
        cells = [f"{rows[row]:,}" for rows in bench["maneuvers_per_cycle"].values()]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _floors(bench: dict[str, Any], isa: str) -> str:
    return f"{bench['floor_us'][isa]:.1f}; {bench['assigned_floor_us'][isa]:.1f}"


def peers_table(bench: dict[str, Any]) -> str:
    """Markdown of what others take for the same vehicles, and how many times as long as our batch that is."""
    isa = list(bench["batch_us"])[-1]
    ours = bench["batch_us"][isa]["networks"]["1024"]["best"]
    lines = [f"| beside | µs a scenario: median (best) | best, times ours ({isa}, 1024) | |", "|---|---|---|---|"]
    for name, row in bench["peers_us"].items():
        if "missing" in row:
            lines.append(f"| {name} | {row['missing']} | | |")
            continue
        us = row["us"]
        lines.append(f"| {name} | {us['median']:,.0f} ({us['best']:,.0f}) | {us['best'] / ours:.1f} | {row['doing']} |")
    return "\n".join(lines)


def speed_block(bench: dict[str, Any]) -> str:
    """Both tables, the latency from Python and what ranking takes."""
    latency = bench["latency_us"]["networks"]
    isa = list(bench["floor_us"])[-1]
    ranked = " and ".join(
        f"{row['networks']['median']:.1f} ms with {row['orders']:,} orders" for row in bench["ranking_ms"].values()
    )
    notes = (
        f"One scenario, called from Python ({isa}): p50 {latency['p50']:.0f}, p99 {latency['p99']:.0f},"
        f" p99.9 {latency['p99.9']:.0f} µs over {latency['calls']:,} calls.\n"
        f"`rank_maneuvers`, smallest distances and table included: {ranked}."
    )
    notes += f"\n{flips_sentence(bench['flips'])}"
    asked = [row["asked"] for row in bench["peers_us"].values() if "asked" in row]
    if asked:
        share = f"{100.0 * asked[0]:.0f} %"
        notes += (
            f"\nOf the floor's pairs and steps {share} are open to a gap decision in this traffic; the network\n"
            "is asked where its answer can change something."
        )
    theirs = [row["core_share"] for row in bench["peers_us"].values() if "core_share" in row]
    if theirs:
        notes += (
            f"\nThe predictor had {100.0 * bench['core_share']:.0f} % of a core to itself while it was timed,"
            f" its peers {100.0 * min(theirs):.0f} to {100.0 * max(theirs):.0f} %."
        )
    return "\n\n".join((speed_table(bench), peers_table(bench), notes))


def flips_sentence(flips: dict[str, Any]) -> str:
    """How often instruction sets decide differently about the same gap."""
    rows = []
    for name, row in flips.items():
        one, best = name.split("-")
        if row["scenarios"] == row["position_m"] == 0.0:
            rows.append(f"{one} and {best} never differ")
            continue
        shares = (
            f"{100.0 * row['decisions']:.3f} % of the decisions, in {100.0 * row['scenarios']:.2f} % of the traffics"
        )
        replayed = f"with decisions replayed, positions differ by at most {1e3 * row['position_m']:.2f} mm"
        rows.append(f"{one} and {best} in {shares}\n({replayed})")
    count = max(row["traffics"] for row in flips.values())
    return (
        f"How often instruction sets decide differently (policy `gap`, {count:,} random traffics of 15 vehicles,"
        " 50 steps):\n" + ";\n".join(rows) + "."
    )


def worlds_table(environments: dict[str, Any]) -> str:
    """Markdown of the batched worlds' agent-steps a second, by kernel, and of how often worlds ended meanwhile."""
    columns = list(environments["worlds"][0]["rates"])
    lines = [f"| million agent-steps/s | {' | '.join(columns)} | worlds that end with a step |"]
    lines.append("|---" * (len(columns) + 2) + "|")
    for row in environments["worlds"]:
        cells = " | ".join(f"{row['rates'][column]['median'] / 1e6:.1f}" for column in columns)
        lines.append(f"| {row['name']} | {cells} | {100.0 * row['ends_per_world_step']:.1f} % |")
    return "\n".join(lines)


def doors_table(environments: dict[str, Any]) -> str:
    """Markdown of the doors' agent-steps a second, and of the peers', which may be missing."""
    lines = ["| one process, one core | thousand agent-steps/s | |", "|---|---|---|"]
    for row in environments["doors"]:
        lines.append(f"| {row['name']} | {_thousands(row['rate']['median'])} | |")
    for row in environments["peers"]:
        figure = row.get("missing") or _thousands(row["rate"]["median"])
        lines.append(f"| {row['name']} | {figure} | {row.get('doing', '')} |")
    return "\n".join(lines)


def _thousands(rate: float) -> str:
    return f"{rate / 1e3:.0f}" if rate >= 1e4 else f"{rate / 1e3:.2f}"


def environments_block(environments: dict[str, Any]) -> str:
    """Both tables, what a frame takes, and how steady the machine was."""
    machine, frame = environments["reference_gflops"], environments["frame_ms"]["median"]
    rates = ", ".join(f"{found['median']:.0f}" for found in machine)
    shares = ", ".join(f"{100.0 * found['core_share']:.0f}" for found in machine)
    notes = (
        f"A frame of 600 x 600 pixels takes {frame:.1f} ms to render. For comparing machines: before the first table,\n"
        f"before the peers and after them a product of 256 x 256 float32 matrices in one thread ran at {rates}\n"
        f"GFLOP/s, with {shares} % of a core to itself; the rest went to others, which slows everything else alike."
    )
    return "\n\n".join((worlds_table(environments), doors_table(environments), notes))


def training_sentence(training: dict[str, float]) -> str:
    """Where an epoch's time goes."""
    parts = {name: training[name] for name in ("collection", "advantages", "one_pass")}
    shares = [f"{name.replace('_', ' ')} {100.0 * taken / sum(parts.values()):.0f} %" for name, taken in parts.items()]
    return (
        f"PPO on one core: {training['million_steps_per_second']:.2f} million agent-steps/s with one pass of updates,"
        " best of five rounds\n"
        f"({', '.join(shares)})."
    )


def gap_table(results: dict[str, Any]) -> str:
    """Markdown of how often gaps are decided rightly, and by how much the network leads, per foe definition."""
    heads = [f"{name} {foes}" for foes in results["foes"] for name in ("accuracy,", "network minus it,")]
    lines = [f"| | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for model in results["foes"]["recorded"]["models"]:
        cells = []
        for part in results["foes"].values():
            found = part["models"][model]
            lead = found.get("network_minus")
            cells += [_percent(found["accuracy"]), _percent(lead["accuracy"]) if lead else ""]
        lines.append(f"| {model} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _percent(interval: dict[str, float]) -> str:
    value, low, high = (100.0 * interval[key] for key in ("value", "low", "high"))
    return f"{value:.1f} [{low:.1f}, {high:.1f}]"


def paper_table(results: dict[str, Any]) -> str:
    """Markdown of the paper's figures with ours beside them."""
    lines = ["| figure | paper, on inD | ours, with 95 % interval | our bar |", "|---|---|---|---|"]
    lines += [f"| {' | '.join(row.cells()[:-1])} |" for row in headlines(results)]
    return "\n".join(lines)
