"""The order network as a torch module; what the core evaluates after export."""

from __future__ import annotations

from collections.abc import Sequence

from agents.networks.scaled import ScaledNetwork

ORDER_HIDDEN = 32  # ours: 16 err more often, 64 no less
OF_LEAD_AND_LENGTH = ((55.0, 0.025), (15.0, 0.08), (4.5, 0.5))
OF_YIELDER = ((20.0, 0.05), (30.0, 0.05), (15.0, 0.05), (3.0, 0.3), (10.0, 0.3), *OF_LEAD_AND_LENGTH)
OF_FOE = ((45.0, 0.03), (55.0, 0.03), (35.0, 0.03), (9.0, 0.25), (13.0, 0.3), *OF_LEAD_AND_LENGTH)
OF_PAIR = ((0.5, 2.0), (4.5, 0.25), (1.5, 0.5), (11.0, 0.3), (0.3, 1.0))
ORDER_SHIFT, ORDER_SCALE = zip(*OF_YIELDER, *OF_FOE, *OF_PAIR, strict=True)
"""Ours: about the middle of each of `ORDER_FEATURES` in traffic, and one by its deviation."""


class OrderNetwork(ScaledNetwork):
    """21/32/32/1 with tanh: features (..., 21), `ORDER_FEATURES`, to the logit of the yielder going first (...,)."""

    def __init__(self, shift: Sequence[float] = ORDER_SHIFT, scale: Sequence[float] = ORDER_SCALE) -> None:
        super().__init__(shift, scale, ORDER_HIDDEN)
