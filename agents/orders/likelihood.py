"""How probable what was recorded is, under the pairs' logits: over all feasible orders of each moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, pad
from torch.nn.utils.rnn import pad_sequence

from agents.orders.samples import OrderSample

IMPOSSIBLE = -1.0e9


@dataclass(frozen=True)
class OrderBatch:
    """Some moments, padded.

    features: (moment, pair, 21); orders: (moment, order, pair), 0 where padded; feasible, possible: (moment, order)
    bool, there at all, and in agreement with the recording; recorded: (moment, pair); undecided: (moment, pair) bool,
    known, though no order decides it.
    """

    features: Tensor
    orders: Tensor
    feasible: Tensor
    possible: Tensor
    recorded: Tensor
    undecided: Tensor

    @classmethod
    def of(cls, samples: Sequence[OrderSample]) -> OrderBatch:
        """These moments, at least one."""
        pairs, orders = max(len(one.recorded) for one in samples), max(len(one.orders) for one in samples)

        def padded(rows: Tensor) -> Tensor:
            return pad(rows, (0, pairs - rows.shape[1], 0, orders - rows.shape[0]))

        decided = [torch.from_numpy((one.orders != 0).any(axis=0)) for one in samples]
        recorded = [torch.from_numpy(one.recorded) for one in samples]
        return cls(
            pad_sequence([torch.from_numpy(one.features) for one in samples], batch_first=True),
            torch.stack([padded(torch.from_numpy(one.orders)) for one in samples]).float(),
            pad_sequence([torch.ones(len(one.orders), dtype=torch.bool) for one in samples], batch_first=True),
            pad_sequence([torch.from_numpy(one.possible) for one in samples], batch_first=True),
            pad_sequence(recorded, batch_first=True).float(),
            pad_sequence([(a != 0) & ~b for a, b in zip(recorded, decided, strict=True)], batch_first=True),
        )

    def loss(self, logit: Tensor) -> Tensor:
        """Minus the mean log likelihood of what was recorded, per moment; logit: (moment, pair).

        An order's weight is the product of its pairs' probabilities. Pairs that no order decides count by themselves.
        """
        feasible = self._weight(logit, self.feasible).logsumexp(1)
        possible = self._weight(logit, self.possible).logsumexp(1)
        return (feasible - possible + self._alone(logit, self.undecided)).mean()

    def pair_loss(self, logit: Tensor) -> Tensor:
        """Minus the log likelihood of each known pair's order by itself, summed over pairs, mean over moments."""
        return self._alone(logit, self.recorded != 0).mean()

    def probability(self, logit: Tensor) -> Tensor:
        """That the yielder goes first (moment, pair): over the feasible orders, or by itself where none decides it."""
        share = self._weight(logit, self.feasible).softmax(1)
        first = torch.einsum("mo,mop->mp", share, (self.orders > 0).float())
        left_open = torch.einsum("mo,mop->mp", share, (self.orders == 0).float())
        return first + left_open * torch.sigmoid(logit)

    def _weight(self, logit: Tensor, among: Tensor) -> Tensor:
        """The logarithm of each order's weight (moment, order), `IMPOSSIBLE` for those not among."""
        weight = 0.5 * torch.einsum("mop,mp->mo", self.orders, logit)
        return weight.masked_fill(~among, IMPOSSIBLE)

    def _alone(self, logit: Tensor, among: Tensor) -> Tensor:
        """Minus the log likelihood of these pairs' orders, each by itself, summed: (moment,)."""
        each = binary_cross_entropy_with_logits(logit, (self.recorded > 0).float(), reduction="none")
        return (each * among).sum(1)
