"""How probably the gap network accepts, over the time gap and by how fast and near the yielder is."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from agents.gap.baselines import EVEN, Floats
from agents.gap.samples import GapSamples, Kinematics
from agents.networks.gap import GapNetwork
from experiments.show.gap import Curve
from intersection_env.features import Gap

SPEEDS = (0.0, 2.0, 4.0, 6.0, 8.0)  # [m/s] of the yielder
SPEED_BAND = 1.0  # [m/s] to either side, whose median distances stand for a speed
FOE_SPEED = 50.0 / 3.6  # [m/s]
GAPS = np.linspace(0.0, 8.0, 161)  # [s]


def acceptance_curves(network: GapNetwork, samples: GapSamples) -> list[Curve]:
    """Crossing and merging, at each of `SPEEDS`, at distances that the samples have at that speed.

    Raises:
        ValueError: the samples have no yielder at one of the speeds.
    """
    curves = []
    for merging in (False, True):
        for speed in SPEEDS:
            to_stop_line, to_pga = typical_distances(samples, speed, merging)
            chance = acceptance(network, speed, to_pga)
            curves.append(Curve(merging, speed, to_stop_line, to_pga, GAPS, chance, critical_gap(chance)))
    return curves


def seen_gap(samples: GapSamples) -> float:
    """The longest gap of a foe in the field of view [s]."""
    return float(samples.features[samples.recorded, Gap.FOE_DISTANCE_TO_STOP_LINE].max()) / FOE_SPEED


def typical_distances(samples: GapSamples, speed: float, merging: bool) -> tuple[float, float]:
    """The median distances to stop line and PGA [m] of yielders before the line at about this speed."""
    to_stop = samples.kinematics[:, Kinematics.DISTANCE_TO_STOP_LINE]
    merges = samples.kinematics[:, Kinematics.MERGING] == 1.0
    near = np.abs(samples.features[:, Gap.SPEED] - speed) <= SPEED_BAND
    chosen = near & (merges == merging) & (to_stop >= 0.0)
    if not chosen.any():
        raise ValueError(f"no yielder at about {speed} m/s before its stop line to take distances from")
    return float(np.median(to_stop[chosen])), float(np.median(samples.features[chosen, Gap.DISTANCE_TO_PGA]))


def acceptance(network: GapNetwork, speed: float, to_pga: float) -> Floats:
    """(gap,) how probable it is that one foe at 50 km/h, `GAPS` away from its stop line, is not waited for."""
    rows = np.stack(np.broadcast_arrays(to_pga, speed, GAPS * FOE_SPEED, FOE_SPEED), axis=1).astype(np.float32)
    return chances(network, rows)


def chances(network: GapNetwork, features: NDArray[np.float32]) -> Floats:
    """(pair,) how probable the network finds it that each foe's gap is accepted; features (pair, `Gap`)."""
    with torch.no_grad():
        found: Floats = torch.sigmoid(network(torch.from_numpy(features)).double()).numpy()
    return found


def critical_gap(chance: Floats) -> float | None:
    """The least gap [s] from which on acceptance is the more probable; None if there is none."""
    refused = np.flatnonzero(chance <= EVEN)
    if len(refused) in (0, len(chance)) or refused[-1] == len(chance) - 1:
        return None
    k = int(refused[-1])
    return float(np.interp(EVEN, chance[k : k + 2], GAPS[k : k + 2]))
