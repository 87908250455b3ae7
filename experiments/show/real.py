"""The page on somebody's own recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.show.crossing_order import order_table
from experiments.show.gap import measures_table
from experiments.show.places import RULE, place_table, population_table, populations
from experiments.show.tables import markdown_table

FEW_SAMPLES = 100  # ours: of as few, a vehicle counts in several moments, single drivers decide
FEW_RECORDINGS = 5  # ours: of fewer, intervals over recordings are too narrow
POPULATIONS = {
    "recorded": "recorded at the start and at the horizon, the paper's choice: mostly those who waited",
    "extrapolated": "not in view yet at the start, so that their start was extrapolated from their own future",
    "until_last_seen": "recorded at the start, all, each at the last moment at which it is recorded: the headline",
    "last_seen": "of those, the ones last seen within the 2 s up to the horizon",
}
KINDS = {
    "recordings": "recordings left out",
    "tracks": "vehicles left out",
    "stretches": "stretches cut out",
    "seconds": "seconds cut out",
    "extrapolation": "extrapolated into the past",
}
MODELS = (
    "`constant_velocity`; the IDM with critical gaps (`idm_critical_gap`), with SUMO's rule (`idm_sumo`) and with the "
    "gap network (`gap`); the calibrated IDM (`idm_calibrated`); the drivers learned by PPO and by GAIL, with the gap "
    "network (`ppo`, `gail`); and the rollout gradient's, with a gap network of its own (`rollout_gradient`)"
)

Json = Mapping[str, Any]


def real_page(results: Json) -> str:
    """The page as Markdown."""
    parts = [
        f"# All that ships, scored on `{results['folder']}`",
        f"{MODELS}. Nothing was learned from the recordings.",
    ]
    if results["is_shipped"]:
        parts[1] = (
            f"{MODELS}. **These are the recordings that ship, from which they learned: this is no test of them.**"
        )
    for name, place in results["places"].items():
        parts += [f"## Map {name}", *_recordings(place), *_in_short(place), *_errors(place), *_order(place)]
        parts += [*_gaps(place), *_traffic(place), *_dropped(place)]
    return "\n\n".join(parts) + "\n"


def _table(heads: Sequence[str | None], rows: Sequence[Sequence[str]]) -> str:
    return markdown_table(heads, rows, RULE)


def _recordings(place: Json) -> Iterator[str]:
    every = place["recordings"]
    recorded = sum(one["seconds"] for one in every)
    vehicles = ", ".join(f"{kind} {count}" for kind, count in place["vehicles"].items()) or "none"
    share = f"{100.0 * place['seconds'] / recorded:.0f} % of the time" if recorded else "nothing"
    yield (
        f"Recordings: {len(every)}, {recorded / 60.0:.1f} min. Left in scenes: {share}; stretches: {place['scenes']}, "
        f"of {place['seconds'] / 60.0:.1f} min in all. Vehicles in them: {vehicles}."
    )
    rows = [
        (
            one["id"],
            "not named" if one["location"] is None else str(one["location"]),
            f"{one['seconds'] / 60.0:.1f}",
            str(one["tracks"]),
        )
        for one in every
    ]
    yield _table(("recording", "location", "min", "tracks"), rows)


def _in_short(place: Json) -> Iterator[str]:
    """What a reader looks for first."""
    lines = []
    everybody = [row for row in place["errors"] if row["population"] == "until_last_seen"]
    for key, what in (("rmse", "RMSE"), ("mad", "MAD")):
        ordered = sorted(everybody, key=lambda row: float(row[key]))
        shown = (f"{row['model']} {row[key]:.1f}" for row in ordered)
        if everybody:
            lines.append(f"where they are when last seen within 10 s, {what} [m]: {', '.join(shown)}")
    if "missing" not in place["order"] and place["order"]["recorded"]["pairs"]:
        models = place["order"]["recorded"]["models"]
        ordered = sorted(models, key=lambda name: -models[name]["accuracy"]["value"])
        shown = (f"{name.replace('_', ' ')} {100.0 * models[name]['accuracy']['value']:.0f}" for name in ordered)
        lines.append(f"crossing orders right [%]: {', '.join(shown)}")
    if "missing" not in place["gaps"]["recorded"]:
        models = place["gaps"]["recorded"]["models"]
        ordered = sorted(models, key=lambda name: -models[name]["accuracy"]["value"])
        shown = (f"{name.replace('_', ' ')} {100.0 * models[name]['accuracy']['value']:.0f}" for name in ordered)
        lines.append(f"gap decisions right [%]: {', '.join(shown)}")
    if lines:
        yield "In short, of vehicles recorded at the start, the best first:\n\n" + "\n".join(
            f"- {one}" for one in lines
        )


def _dropped(place: Json) -> Iterator[str]:
    yield "### What was left out or cut, by reason"
    rows = []
    for kind, what in KINDS.items():
        for reason, count in place["dropped"].items():
            if reason.startswith(f"{kind}: "):
                rows.append((what, reason.removeprefix(f"{kind}: "), f"{count:g}"))
    yield _table(("", "reason", ""), rows) if rows else "Nothing."


def _traffic(place: Json) -> Iterator[str]:
    yield "### The traffic"
    if "missing" in place["traffic"]:
        yield _cannot("the traffic", place["traffic"])
    else:
        yield f"```\n{place['traffic']['text']}\n```"
    if place["speeds"]:
        yield "Cars and trucks in view, by route; limits as the map has them:"
        rows = [
            (
                *(row["route"], str(row["vehicles"]), f"{row['median']:.1f}", f"{row['q85']:.1f}"),
                *(f"{row['least']:.1f} to {row['most']:.1f}", f"{100.0 * row['faster']:.0f} %"),
            )
            for row in place["speeds"]
        ]
        yield _table(("route", "vehicles", "median [m/s]", "85 % [m/s]", "limit [m/s]", "of the time above it"), rows)


def _errors(place: Json) -> Iterator[str]:
    yield "### Predictions"
    rows = place["errors"]
    yield (
        f"From {place['moments']} moments, one a second, of all vehicles jointly; {place['refused']} more were left"
        " out as vehicles overlap in them. Cars and trucks are scored: predicted minus recorded distance along the"
        " route, and time lost likewise. MAD is the median of the absolute error."
    )
    if not rows:
        yield _cannot("predictions", {"missing": "no car or truck is recorded 2 s or more after a moment"})
    found = populations(rows)
    for one in [*found, *(name for name in ("recorded", "extrapolated") if rows and name not in found)]:
        yield f"Vehicles {POPULATIONS.get(one, one)} (*{one}*):"
        yield from _population(place, one)


def _population(place: Json, population: str) -> Iterator[str]:
    counts = {
        row["horizon"]: row["count"] for row in place["errors"] if row["population"] == population and "count" in row
    }
    if not counts:
        yield "**None**: this population cannot be scored."
        return
    if len(counts) > 1:
        yield population_table(place["errors"], population)
    last = max(row["horizon"] for row in place["errors"])
    if population != "last_seen":
        yield f"At {max(counts):g} s:"
        yield place_table([row for row in place["errors"] if row["population"] == population])
    if max(counts) < last and len(counts) > 1:
        yield f"**Nobody** of it is recorded beyond {max(counts):g} s."
    few = [f"{horizon:g} s ({count:g})" for horizon, count in counts.items() if count < FEW_SAMPLES]
    if few:
        yield f"**Few samples**, of which single drivers decide: at {', '.join(few)}."


def _order(place: Json) -> Iterator[str]:
    yield "### Crossing orders"
    found = place["order"]
    if "missing" in found:
        yield _cannot("crossing orders", found)
        return
    yield (
        "How often [%] the predicted order of a pair is the recorded one. Beside the models: who has priority goes"
        " first (*priority first*), the IDM with SUMO's rule (*sumo rule*) and with critical gaps (*critical gap*)."
    )
    yield order_table(found)
    yield from _warnings(found["recordings"], found["recorded"]["pairs"], "pairs recorded at the start")


def _gaps(place: Json) -> Iterator[str]:
    yield "### Gap decisions"
    for foes, found in place["gaps"].items():
        if "missing" in found:
            yield _cannot(f"gap decisions, {foes} foes", found)
    there = {foes: found for foes, found in place["gaps"].items() if "missing" not in found}
    if there:
        yield (
            "How often [%] it is decided rightly, frame by frame, whether a yielder goes before all its foes: by the"
            " gap network, by always waiting, and by rules. Of foes in view alone (*recorded*), or also of those"
            " extrapolated (*all*)."
        )
        yield measures_table(there)
    said = [
        one
        for foes, found in there.items()
        for one in _warnings(found["recordings"], found["samples"], f"samples with {foes} foes")
    ]
    yield from dict.fromkeys(said)


def _warnings(recordings: int, samples: int, what: str) -> Iterator[str]:
    if samples < FEW_SAMPLES:
        yield f"**Few samples**, of which single drivers decide: {samples} {what}."
    if recordings < FEW_RECORDINGS:
        yield (
            f"**Intervals** are over recordings, and there are {recordings}: of fewer than {FEW_RECORDINGS} they say"
            " little."
        )


def _cannot(what: str, found: Json) -> str:
    return f"**Cannot be scored: {what}.** {found['missing']}"
