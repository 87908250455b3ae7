"""What will happen, and how probable: crossing orders with probabilities, and where everybody will be under each."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intersection_env import _core
from intersection_env.arguments import check_type, number, whole_number
from intersection_env.prediction.maneuvers import LIMIT, in_words, seconds_budget
from intersection_env.prediction.noise import Noise, drawn, on_pairs, still_open
from intersection_env.prediction.predictor import Prediction, Predictor, Priorities, as_assignments
from intersection_env.traffic import Traffic, naming

MASS, MOST = 0.95, 64
SCENARIOS = ("position", "speed", "acceleration", "enters", "present", "time_loss", "minimum_distance")
TRIES = 100  # ours: of drawing a noisy traffic that can be


@dataclass(frozen=True, eq=False)
class Forecast:
    """The next 10 s: the most probable crossing orders, and the prediction of each.

    orders: (order, pair) int8 over `traffic.conflicts`, +1 yielder first, -1 prioritized first; the most probable
        first. 0 is left to the gap decision: where neither can stop any more, and all of them where no order is
        feasible. With noise, what is probable in the draws need not be possible in the traffic.
    probability: (order,) float64, over all feasible orders, so that those left away are missing from the sum.
    yielder_first: (pair,) float64, the probability that the yielder of each pair goes first; over all feasible orders.
    feasible: orders among which the probability was shared out; left_out: further ones, counted up to 20,000.
    prediction: scenario k is that of order `order[k]`, and `weight[k]` (scenario,) is its share of what is predicted:
        without noise the orders in turn, with it several a draw, which begin where that one puts the vehicles.
    """

    predictor: Predictor
    traffic: Traffic
    orders: NDArray[np.int8]
    probability: NDArray[np.float64]
    yielder_first: NDArray[np.float64]
    feasible: int
    left_out: int
    prediction: Prediction
    order: NDArray[np.int64]
    weight: NDArray[np.float64]

    def most_probable(self) -> Prediction:
        """The prediction (one scenario) of the most probable order; with noise, of the draw in which it weighs most."""
        likely = int(np.where(self.order == 0, self.weight, -1.0).argmax())
        every, one = self.prediction, slice(likely, likely + 1)
        rows = {name: getattr(every, name)[one] for name in SCENARIOS}
        memories: dict[str, Any] = {}
        if every.hold is not None and every.priorities is not None:
            memories = {"hold": every.hold[one], "priorities": every.priorities[one], "patience": every.patience}
            memories["waited"] = None if every.waited is None else every.waited[one]
        return Prediction(traffic=self.traffic, time=every.time, **rows, **memories)

    def words(self) -> list[str]:
        """The orders as sequences of vehicles, as `rank_maneuvers` names them."""
        return in_words(self.traffic, self.orders)

    def mean_position(self) -> NDArray[np.float64]:
        """(time, vehicle) [m], over the orders: what errs least in the mean square."""
        mean: NDArray[np.float64] = np.einsum("s,stv->tv", self.weight, self.prediction.position.astype(np.float64))
        return mean

    def position_quantiles(self, levels: ArrayLike = (0.1, 0.5, 0.9)) -> NDArray[np.float32]:
        """(level, time, vehicle) [m]: over the orders, and over what drivers do within one.

        Args:
            levels: from 0 to 1.

        Raises:
            ValueError: a level out of range.
        """
        policy, position = self.predictor.core_policy, self.prediction.position
        return _core.position_quantiles(policy, self.weight, position, _checked(levels))

    def time_loss_quantiles(self, levels: ArrayLike = (0.1, 0.5, 0.9)) -> NDArray[np.float64]:
        """(level, vehicle) [s], over the orders.

        Args:
            levels: from 0 to 1.

        Raises:
            ValueError: a level out of range.
        """
        return np.quantile(
            self.prediction.time_loss.astype(np.float64),
            _checked(levels),
            axis=0,
            weights=np.repeat(self.weight[:, None], len(self.traffic), axis=1),
            method="inverted_cdf",
        )

    def expected_time_loss(self) -> NDArray[np.float64]:
        """(vehicle,) [s], over the orders.

        These are the orders that are predicted, by default 95 % of the probability, so that the sum differs a little
        from what `rank_maneuvers` says of no intervention, which is over all orders; with `mass=1` and `most` above the
        number of orders it is the same.
        """
        return self.weight @ self.prediction.time_loss.astype(np.float64)


def forecast(
    predictor: Predictor,
    traffic: Traffic,
    priorities: Priorities | None = None,
    *,
    mass: float = MASS,
    most: int = MOST,
    limit: int | None = LIMIT,
    seconds: float | None = None,
    noise: Noise | None = None,
) -> Forecast:
    """The most probable crossing orders of a traffic, and the prediction of each.

    The probability of an order is in proportion to the product of its pairs' probabilities, which a network gives, over
    all feasible orders.

    Args:
        predictor: whose policy holds an order network: those that ship do.
        traffic: the vehicles now.
        priorities: what is sure, as a maneuver imposes it: as of `Predictor.predict`, of one scenario.
        mass: predict as many orders as have this probability together,
        most: but no more than these.
        limit: orders that share the probability at most; where there are more, they begin with the one in which each
            pair goes as is more probable, and the least certain pairs change first. None: all, however many.
        seconds: search orders that share the probability no longer than so long, for each traffic that is drawn; what
            comes out then depends on the machine.
        noise: by what the traffic may err; without, it is taken at its word.

    Raises:
        TypeError: an argument of another type, or priorities of another dtype.
        ValueError: a policy without an order network; priorities that are refused, or of several scenarios; a limit
            out of range; or no traffic could be drawn in which nobody overlaps.
    """
    check_type("predictor", predictor, Predictor)
    check_type("traffic", traffic, Traffic)
    if not predictor.core_policy.can_forecast:
        raise ValueError(
            f'the policy "{predictor.name}" holds no order network; `python -m agents.orders` adds one to a policy file'
        )
    counts: dict[str, object] = {"most": most} if limit is None else {"most": most, "limit": limit}
    for name, value in counts.items():
        if whole_number(name, value) < 1:
            raise ValueError(f"{name} must be at least 1, not {value}")
    if noise is not None and not isinstance(noise, Noise):
        raise TypeError(f"noise must be a Noise, not {noise!r}")
    given = as_assignments(traffic, priorities)
    if len(given) != 1:
        raise ValueError(f"priorities of a forecast are of one scenario, not of {len(given)}")
    budget = number("mass", mass), most, sys.maxsize if limit is None else limit, seconds_budget(seconds)
    if noise is None:
        return _forecast(predictor, traffic, given[0], budget)
    generator = np.random.default_rng(noise.seed)
    draws = [_drawn(predictor, traffic, given[0], noise, generator, budget) for _ in range(noise.draws)]
    return _average(predictor, traffic, draws)


def _checked(levels: ArrayLike) -> NDArray[np.float64]:
    """One level or a row of them, as a row."""
    wanted = np.ascontiguousarray(np.atleast_1d(np.asarray(levels, dtype=np.float64)))
    if wanted.ndim != 1 or not ((wanted >= 0.0) & (wanted <= 1.0)).all():
        raise ValueError(f"levels must be a row of numbers from 0 to 1, not {levels!r}")
    return wanted


def _forecast(
    predictor: Predictor, traffic: Traffic, given: NDArray[np.int8], budget: tuple[float, int, int, float]
) -> Forecast:
    bound = predictor.bound_to(traffic.intersection)
    with naming(traffic.ids):
        orders, probability, yielder_first, feasible, left_out = _core.order_probabilities(
            bound, traffic.core, given, *budget
        )
    prediction = predictor.predict(traffic, orders)
    for array in (orders, probability, yielder_first):
        array.setflags(write=False)
    return Forecast(
        predictor,
        traffic,
        orders,
        probability,
        yielder_first,
        feasible,
        left_out,
        prediction,
        np.arange(len(orders)),
        probability / probability.sum(),
    )


def _drawn(
    predictor: Predictor,
    traffic: Traffic,
    given: NDArray[np.int8],
    noise: Noise,
    generator: np.random.Generator,
    budget: tuple[float, int, int, float],
) -> Forecast:
    """The forecast of a traffic that errs; drawn again where vehicles overlap or what is given cannot be."""
    sure = traffic.words(given)
    refused = ""
    for _ in range(TRIES):
        try:
            other = drawn(traffic, noise, generator)
            return _forecast(predictor, other, still_open(other, sure), budget)
        except ValueError as error:
            refused = str(error)
    raise ValueError(f"no traffic with such noise in {TRIES} draws; of the last one: {refused}")


def _average(predictor: Predictor, traffic: Traffic, draws: Sequence[Forecast]) -> Forecast:
    """All draws as one: orders are those of the traffic's own pairs, 0 where a draw has none."""
    mapped = [on_pairs(traffic, draw.traffic, draw.orders, draw.yielder_first) for draw in draws]
    orders, order = np.unique(np.concatenate([rows for rows, _ in mapped]), axis=0, return_inverse=True)
    each = np.concatenate([draw.probability for draw in draws]) / len(draws)
    probability = np.bincount(order.ravel(), each, minlength=len(orders)).astype(np.float64)
    rank = np.argsort(-probability, kind="stable")
    place = np.empty(len(rank), np.int64)
    place[rank] = np.arange(len(rank))
    parts = [draw.prediction for draw in draws]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in SCENARIOS}
    return Forecast(
        predictor,
        traffic,
        orders[rank],
        probability[rank],
        np.mean([first for _, first in mapped], axis=0),
        max(draw.feasible for draw in draws),
        max(draw.left_out for draw in draws),
        Prediction(traffic=traffic, time=parts[0].time, **joined),
        place[order.ravel()],
        np.concatenate([draw.weight for draw in draws]) / len(draws),
    )
