"""What the networks see: their features by name and unit, and the columns of arrays that hold them."""

from __future__ import annotations

from enum import IntEnum

from intersection_env import _core

GAP_FEATURES: tuple[str, ...] = tuple(_core.gap_features())
"""The gap network's inputs in order, with units, as a policy file names them."""
DRIVING_FEATURES: tuple[str, ...] = tuple(_core.driving_features())
"""The driving network's inputs, likewise."""
ORDER_FEATURES: tuple[str, ...] = tuple(_core.order_features())
"""The order network's inputs, likewise: of both vehicles of a pair, and of the other foes of both."""


class Gap(IntEnum):
    """Columns of `Observation.gap`; paper, Table I."""

    DISTANCE_TO_PGA = 0
    SPEED = 1
    FOE_DISTANCE_TO_STOP_LINE = 2
    FOE_SPEED = 3


class Driving(IntEnum):
    """Columns of `Observation.driving` and of what agents observe; paper, Table I.

    HEADINGS is the first of six: relative headings at -10, -3, 3, 10, 30 and 100 m.
    """

    DISTANCE_TO_STOP_LINE = 0
    SPEED = 1
    V_MAX = 2
    HEADINGS = 3
    LEAD_DISTANCE = 9
    LEAD_SPEED = 10
    ENTERS = 11
