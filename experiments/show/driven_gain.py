"""Shows what the best maneuvers saved as SUMO drove them, beside what was predicted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.show.style import BLUE, QUIET, RED, set_style
from experiments.show.tables import in_percent, in_unit, markdown_table
from intersection_env.prediction.maneuvers import WORTHWHILE_GAIN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RANKINGS = {"expectation": "by expectation", "prediction": "by prediction"}
POPULATIONS = {
    "all": "all",
    "order_kept": "order kept",
    "order_not_kept": "order not kept",
    "already_so": "order as without it",
}
BARS = {
    "real_expectation": "by expectation, at least 80 % of the gains above 2 s are real",
    "real_prediction": "by prediction, at least 80 % of the gains above 2 s are real",
    "expectation_not_below_prediction": "by expectation, the mean realised gain is not below that by prediction",
}


def driven_text(results: Mapping[str, Any]) -> str:
    """Gains, the rule and regret as tables, which bars are met, intervals in brackets; or why nothing was driven."""
    if results["missing"]:
        return "Not driven: " + " ".join(f"{name}: {why}." for name, why in results["missing"].items())
    noise, gap = results["noise"], results["expectation_minus_prediction"]
    kept = "; ".join(
        f"{RANKINGS[by]} it was kept in {in_percent(one['kept'], '%')} of the moments, nobody would have crossed"
        f" against it anyway in {in_percent(one['already'], '%')}, and {one['without_maneuver']} moments had none"
        for by, one in results["rankings"].items()
    )
    bars = "\n".join(f"- {text}: {'met' if results['bars'][name] else 'missed'}" for name, text in BARS.items())
    return (
        f"{results['moments']} moments of {results['recordings']} recordings, policy {results['policy']}, best"
        f" safe order imposed on all vehicles; {kept}. Another seed of SUMO alone changes all vehicles' time loss by"
        f" {noise['median']:.2f} s (median; {noise['p90']:.2f} s at 90 %).\n\n"
        f"{gains_table(results)}\n\n{rule_table(results)}\n\n{safety_table(results)}\n\n"
        f"{_likely_text(results['rankings']['expectation']['all'])}"
        f"Mean realised gain by expectation minus by prediction: {in_unit(gap['always'], 's')}; where gains above 2 s"
        f" are executed, {in_unit(gap['by_rule'], 's')}.\n\n{bars}"
    )


def _likely_text(found: Mapping[str, Any]) -> str:
    """Of gains above 2 s that are likely to be; nothing where there are none."""
    one = found["likely"]
    if one is None:
        return ""
    return (
        f"Of the gains above 2 s by expectation, {one['moments']} have a chance of at least 80 % to exceed 2 s: real in"
        f" {in_percent(one['real'], '%')}, above 2 s in {in_percent(one['real_worthwhile'], '%')}, realised"
        f" {in_unit(one['realised'], 's')}.\n\n"
    )


def gains_table(results: Mapping[str, Any]) -> str:
    """Predicted and realised gains, of all moments and by whether the order was kept."""
    heads = (
        *("ranking", "moments", "predicted gain [s]", "realised in 10 s [s]", "in 20 s [s]", "correlation"),
        "loss saved [%]",
    )
    rows = [
        (
            f"{RANKINGS[by]}, {POPULATIONS[population]}",
            *(str(one["moments"]), in_unit(one["predicted"]), in_unit(one["realised"]), in_unit(one["later"])),
            *(in_unit(one["correlation"]), in_percent(one["saved"])),
        )
        for by, population, one in _populations(results)
    ]
    return markdown_table(heads, rows)


def rule_table(results: Mapping[str, Any]) -> str:
    """What became of predicted gains above 2 s, and what is lost against the best choice."""
    heads = (
        *("ranking", "predicted above 2 s", "real [%]", "real above 2 s [%]", "realised there [s]", "in 20 s [s]"),
        *("gain by the rule, a moment [s]", "regret [s]", "regret, always executed [s]"),
        *("moments with all orders driven", "best of them [s]", "regret [s]"),
    )
    rows = []
    for by, population, one in _populations(results):
        there, all_driven = one["promised"], one["searched"]
        promised = (
            5 * ("",)
            if there is None
            else (
                *(str(there["moments"]), in_percent(there["real"]), in_percent(there["real_worthwhile"])),
                *(in_unit(there["realised"]), in_unit(there["later"])),
            )
        )
        searched = (
            3 * ("",)
            if all_driven is None
            else (*(str(all_driven["moments"]), in_unit(all_driven["best"]), in_unit(all_driven["regret"])),)
        )
        own = (in_unit(one[name]) for name in ("by_rule", "regret", "regret_always"))
        rows.append((f"{RANKINGS[by]}, {POPULATIONS[population]}", *promised, *own, *searched))
    return markdown_table(heads, rows)


def safety_table(results: Mapping[str, Any]) -> str:
    """Collisions and hard braking, in percent of the runs."""
    heads = (
        "of all moments, within 20 s",
        *(f"{one} [%]" for one in ("bodies overlap", "nearer than 0.5 m", "braking above 4 m/s²")),
    )
    rows = [
        (RANKINGS[by], *(in_percent(one["all"][name]) for name in ("hit", "near", "hard")))
        for by, one in results["rankings"].items()
    ]
    plain = results["rankings"]["expectation"]["all"]
    rows.append(("no intervention", *(in_percent(plain[f"{name}_without"]) for name in ("hit", "near", "hard"))))
    return markdown_table(heads, rows)


def _populations(results: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Those that have moments."""
    for by, figures in results["rankings"].items():
        for population in POPULATIONS:
            if figures[population] is not None:
                yield by, population, figures[population]


def plot_driven(results: Mapping[str, Any]) -> Figure:
    """Realised over predicted gains, a point a moment, for both rankings.

    Args:
        results: as `driven_results` gives them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 3.5), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, (by, points), colour in zip(panels, results["points"].items(), (BLUE, RED), strict=True):
        _draw_points(axes, np.asarray(points), colour)
        axes.set_title(f"Ranked {RANKINGS[by]}", fontsize=9, loc="left")
        set_style(axes)
        axes.set_axisbelow(True)
    panels[0].set_ylabel("gain realised in 10 s [s]")
    return figure


def _draw_points(axes: Axes, points: np.ndarray[Any, np.dtype[np.float64]], colour: str) -> None:
    both = np.append(points, 0.0)
    axes.plot(*2 * ([both.min(), both.max()],), color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.axhline(0.0, color=QUIET, linewidth=0.8)
    axes.axvline(WORTHWHILE_GAIN, color=QUIET, linewidth=0.8)
    axes.scatter(points[:, 0], points[:, 1], s=9.0, color=colour, alpha=0.6, linewidths=0.0)
    axes.set_xlabel("gain predicted [s]")
