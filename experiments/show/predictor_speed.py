"""Shows how fast the predictor is: beside the floor that the machine sets it, and beside others."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

from experiments.show.tables import markdown_table

WIDTH = 120  # of a line of prose
SPEED_ROWS = (
    ("1 scenario", "single_us", "networks", None),
    ("64", "batch_us", "networks", "64"),
    ("1024", "batch_us", "networks", "1024"),
    ("1024, {cores} cores", "threads_us", "networks", "1024"),
    ("1024, with smallest distances", "batch_us", "networks, with distances", "1024"),
    ("all priorities assigned, 64", "assigned_us", "assigned", "64"),
    ("all priorities assigned, 1024", "assigned_us", "assigned", "1024"),
    ("crossing orders together, 64", "assigned_us", "assigned, together", "64"),
    ("crossing orders together, 1024", "assigned_us", "assigned, together", "1024"),
    ("the same, with smallest distances", "assigned_us", "assigned, together, with distances", "1024"),
    ("rules and IDM instead of networks, 1", "single_us", "idm", None),
    ("rules and IDM instead of networks, 1024", "batch_us", "idm", "1024"),
)
"""Name (`cores`: the machine's); in the results file: which times, which driver, how many scenarios."""
CYCLE_ROWS = {
    "maneuvers in 200 ms": "networks",
    "the same, all priorities assigned": "assigned",
    "the same, crossing orders together": "assigned, together",
}


def speed_section(bench: Mapping[str, Any]) -> str:
    """Both tables, the latency from Python, what ranking takes, and where the machine's time went."""
    latency, isa = bench["latency_us"]["networks"], list(bench["floor_us"])[-1]
    ranked = " and ".join(
        f"{row['networks']['median']:.1f} ms with {row['orders']:,} orders" for row in bench["ranking_ms"].values()
    )
    notes = [
        f"One scenario, called from Python ({isa}): p50 {latency['p50']:.0f}, p99 {latency['p99']:.0f},"
        f" p99.9 {latency['p99.9']:.0f} µs over {latency['calls']:,} calls.",
        f"`rank_maneuvers`, smallest distances and table included: {ranked}.",
        *forecast_sentences(bench.get("forecast")),
        flips_sentence(bench["flips"]),
    ]
    asked = [row["asked"] for row in bench["peers_us"].values() if "asked" in row]
    if asked:
        notes.append(
            f"Of the floor's pairs and steps {100.0 * asked[0]:.0f} % are open to a gap decision in this traffic;"
            " the network\nis asked where its answer can change something."
        )
    theirs = [row["core_share"] for row in bench["peers_us"].values() if "core_share" in row]
    if theirs:
        notes.append(
            f"The predictor had {100.0 * bench['core_share']:.0f} % of a core to itself while it was timed,"
            f" its peers {100.0 * min(theirs):.0f} to {100.0 * max(theirs):.0f} %."
        )
    return "\n\n".join((speed_table(bench), peers_table(bench), "\n".join(notes)))


def forecast_sentences(found: Mapping[str, Any] | None) -> list[str]:
    """What a forecast takes beside the ranking of all orders, in lines; nothing where it was not timed."""
    if found is None:
        return []
    said = []
    for name, call in (("python", "`forecast`"), ("cpp", "`Planner::forecast`")):
        row = found[name]
        said.append(
            f"{call}: {row['missing']}"
            if "missing" in row
            else f"{call} {row['forecast_ms']['median']:.2f} ms, {row['to_ranking']:.3f} of what ranking them all takes"
            f" in turns, p99 {row['p99_to_median']:.2f} times the median"
        )
    text = (
        f"The probabilities of {found['orders']:,} orders, and the trajectories of the {found['predicted']} most"
        f" probable: {'; '.join(said)}."
    )
    return wrap(f"{text} {cycle_text(found['cycle'])}." if "cycle" in found else text, WIDTH)


def cycle_text(row: Mapping[str, Any]) -> str:
    """What a ranking takes that ends by itself, in words."""
    return (
        f"`rank_maneuvers` of {row['vehicles']} vehicles with more orders than it predicts by default:"
        f" {row['orders']} of them in {row['ranking_ms']['median']:.0f} ms"
    )


def speed_table(bench: Mapping[str, Any]) -> str:
    """Microseconds a scenario by kernel, their ratios to the floor, and maneuvers a cycle."""
    floors = {isa: (floor, bench["assigned_floor_us"][isa]) for isa, floor in bench["floor_us"].items()}
    rows = [("floor; all assigned", *(f"{free:.1f}; {assigned:.1f}" for free, assigned in floors.values()))]
    for name, times, driver, scenarios in SPEED_ROWS:
        cells = []
        for isa, (free, assigned) in floors.items():
            found = bench[times][isa][driver]
            found = found if scenarios is None else found[scenarios]
            floor = assigned if times == "assigned_us" else free
            ratio = "" if driver == "idm" else f"; {found['best'] / floor:.2f}"
            cells.append(f"{found['median']:.1f} ({found['best']:.1f}{ratio})")
        rows.append((name.format(cores=bench["cores"]), *cells))
    for name, driver in CYCLE_ROWS.items():
        rows.append((name, *(f"{of_isa[driver]:,}" for of_isa in bench["maneuvers_per_cycle"].values())))
    return markdown_table(("µs a scenario: median (best; best to floor)", *floors), rows)


def peers_table(bench: Mapping[str, Any]) -> str:
    """What others take for the same vehicles, and how many times as long as our batch that is."""
    isa = list(bench["batch_us"])[-1]
    ours = bench["batch_us"][isa]["networks"]["1024"]["best"]
    rows: list[tuple[str | None, ...]] = []
    for name, row in bench["peers_us"].items():
        if "missing" in row:
            rows.append((name, row["missing"], None, None))
            continue
        us = row["us"]
        rows.append((name, f"{us['median']:,.0f} ({us['best']:,.0f})", f"{us['best'] / ours:.1f}", row["doing"]))
    heads = ("beside", "µs a scenario: median (best)", f"best, times ours ({isa}, 1024)", None)
    return markdown_table(heads, rows)


def flips_sentence(flips: Mapping[str, Any]) -> str:
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
