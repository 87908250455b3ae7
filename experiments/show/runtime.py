"""Shows runtimes: as text to print, and as a figure for one column of a paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from experiments.show.style import BLUE, RED, set_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMN = (3.5, 3.1)  # [in], as wide as a column of an IEEE paper
SOLID, DASHED, DOTTED = "-", (0.0, (4.0, 2.0)), (0.0, (1.0, 1.5))
LOOKS: dict[str, tuple[str, str, Any]] = {
    "ours": ("ours, one scenario", BLUE, SOLID),
    "ours, batch": ("ours, batch of {batch}", BLUE, DASHED),
    "IDM": ("IDM, one scenario", "#5a9a4c", SOLID),
    "IDM, batch": ("IDM, batch of {batch}", "#5a9a4c", DASHED),
    "libsumo": ("libsumo, restored", RED, SOLID),
    "libsumo, steps alone": ("libsumo, steps alone", RED, DOTTED),
    "torch": ("plain torch, one scenario", "#8a63a8", SOLID),
}
"""By model: name, colour and line."""
SCARCE = 8  # numbers of vehicles, below which each gets a marker


def plot_runtimes(results: Mapping[str, Any]) -> Figure:
    """Mean milliseconds a scenario over the number of vehicles: a line a model, and the paper's bound.

    Args:
        results: as `runtime_results` gives them.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import MultipleLocator

    figure = Figure(figsize=COLUMN, layout="constrained")
    axes = figure.subplots()
    for name, model in _found(results):
        label, colour, line = LOOKS[name]
        sizes, means = [int(size) for size in model], [row["mean"] for row in model.values()]
        marker = "o" if len(sizes) < SCARCE else None
        looks: dict[str, Any] = {"color": colour, "linestyle": line, "linewidth": 1.3, "marker": marker}
        axes.plot(sizes, means, markersize=3.0, label=label.format(**results), **looks)
    paper = results["paper"]
    axes.scatter(
        paper["vehicles"],
        paper["ms"],
        marker="v",
        s=26.0,
        color="black",
        zorder=3.0,
        label=f"paper, {paper['vehicles']} vehicles",
    )
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MultipleLocator(2.0, offset=1.0))
    axes.set_xlabel("vehicles", fontsize=8)
    axes.set_ylabel("runtime of 10 s [ms]", fontsize=8)
    axes.tick_params(labelsize=8)
    set_style(axes)
    figure.legend(loc="outside lower center", ncols=2, fontsize=7, frameon=False, handlelength=2.2, columnspacing=1.0)
    return figure


def runtimes_text(results: Mapping[str, Any]) -> str:
    """Mean and median milliseconds a scenario by number of vehicles, and what follows from them."""
    found = dict(_found(results))
    lines = [f"ms a scenario, mean (median); {results['scenes']} scenes, batches of {results['batch']}"]
    lines.append("".join((f"{'vehicles':>8}{'pairs':>7}", *(f"{name:>22}" for name in found))))
    for size, pairs in results["pairs"].items():
        cells = (_cell(model.get(size)) for model in found.values())
        lines.append("".join((f"{size:>8}{pairs:7.1f}", *(f"{cell:>22}" for cell in cells))))
    for name, row in results["models"].items():
        lines.append(f"{name}: " + row.get("missing", row.get("doing")))
    for name, found_fits in results["fits"].items():
        for statistic, of in found_fits.items():
            a, b, c = (1e3 * value for value in of["quadratic"]["coefficients"])
            shares = [100.0 * of[kind]["explained"] for kind in ("quadratic", "linear")]
            lines.append(
                f"{name}, {statistic}: {a:.3g} {b:+.3g} n {c:+.3g} n² µs, which explains {shares[0]:.2f} %"
                f" of the variance; linear {shares[1]:.2f} %"
            )
    paper = results["paper"]
    lines.append(f"maneuvers in 200 ms: {results['maneuvers_per_cycle']}; paper: over {paper['maneuvers_per_cycle']}")
    machine = ", ".join(f"{one['median']:.0f}" for one in results["reference_gflops"])
    lines.append(
        f"{results['isa']}, {machine} GFLOP/s before and after, {100.0 * results['core_share']:.0f} % of a core"
    )
    return "\n".join(lines)


def _found(results: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The models that are not missing, and their rows by number of vehicles."""
    for name, model in results["models"].items():
        if "vehicles" in model:
            yield name, model["vehicles"]


def _cell(row: Mapping[str, float] | None) -> str:
    return "-" if row is None else f"{row['mean']:.4f} ({row['median']:.4f})"
