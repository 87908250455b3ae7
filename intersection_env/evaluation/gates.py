"""What a policy must pass to be the default, however well it predicts: obedience, the empty road, few collisions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from intersection_env.evaluation.empty_road import EmptyRoad, empty_road
from intersection_env.evaluation.moments import Moment
from intersection_env.evaluation.obedience import Findings, obedience
from intersection_env.prediction.predictor import Predictor

LEAST_SPEED = 0.5
"""On an empty road, of the calibrated IDM's, from any start; ours: who stands, or crawls, is no driver.

Not more, as that IDM slows for bends alone: with nobody ahead and nobody to wait for, recorded drivers who turn left
from the main road pass the last metres before the line at 4.8 m/s in the median (Bendplatz, SE-SW), it at 8.8."""
LEAST_MEAN_SPEED = 0.9
"""Likewise, the mean over all starts."""
MOST_COLLISIONS = 0.02
"""Share of the predictions in which vehicles collide, as none of a scene's recorded ones do; ours: IDM and networks
that keep behind their lead and at their line come to 0.9 to 2.6 %, constant velocity to 42 % (Bendplatz, development;
bodies are rectangles)."""


@dataclass(frozen=True)
class Gates:
    """What a policy does that no error figure shows."""

    empty_road: EmptyRoad
    obedience: Findings
    collisions: float
    """Share of predictions from recorded moments in which vehicles collide."""

    def refusals(self) -> list[str]:
        """Why the policy may not be the default; empty if it may."""
        found = []
        share = "of the calibrated IDM's speed on an empty road"
        if self.empty_road.least < LEAST_SPEED:
            found.append(f"{self.empty_road.least:.2f} {share}, wanted {LEAST_SPEED} ({self.empty_road.where})")
        if self.empty_road.mean < LEAST_MEAN_SPEED:
            found.append(f"{self.empty_road.mean:.2f} {share} in the mean, wanted {LEAST_MEAN_SPEED}")
        if self.obedience.wrong:
            found.append(f"disobeys {len(self.obedience.wrong)} times, first {self.obedience.wrong[0]}")
        if self.collisions > MOST_COLLISIONS:
            found.append(
                f"collisions in {self.collisions:.1%} of the predictions, wanted at most {MOST_COLLISIONS:.0%}"
            )
        return found

    @property
    def passed(self) -> bool:
        """Whether the policy may be the default."""
        return not self.refusals()


def gates(predictor: Predictor, moments: Sequence[Moment], reference: Predictor | None = None) -> Gates:
    """Looks at a policy on the empty road of every shipped map, and in predictions from recorded moments.

    Args:
        predictor: the policy.
        moments: as `moments_of` gives them.
        reference: whose speed is wanted on an empty road; None: the calibrated IDM that ships.

    Raises:
        ValueError: no moments.
    """
    return Gates(empty_road(predictor, reference), obedience(predictor, moments), collisions(predictor, moments))


def collisions(predictor: Predictor, moments: Sequence[Moment]) -> float:
    """The share of the predictions from these moments in which vehicles collide (their bodies overlap).

    Raises:
        ValueError: no moments.
    """
    if not moments:
        raise ValueError("no moments to look for collisions from")
    touching = (predictor.predict(one.traffic, trajectories=False).minimum_distance[0] <= 0.0 for one in moments)
    return sum(map(bool, touching)) / len(moments)
