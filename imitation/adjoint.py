"""How much each weight of both networks moves the error of predictions, by the adjoint method.

The core predicts. What was decided and who led in each step is read from there; how accelerations depend on what
drivers saw, torch says for all steps at once. Then the effect of each acceleration on the error is summed up from the
last step to the first, through positions and speeds, own and of those behind. It is what torch finds through the steps
of `TorchPredictor` one by one, in a fifth of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from imitation.torch_model import Pairs, Seen, TorchPredictor
from imitation.torch_networks import View
from intersection_env.constants import DT, FREE_LEAD_SPEED, LEAD_RANGE


class Rollout(NamedTuple):
    """What the core predicted, at the start and after each step: (time, moment, vehicle) each.

    position [m], speed [m/s]; enters, present: bool.
    """

    position: Tensor
    speed: Tensor
    enters: Tensor
    present: Tensor


class Motion(NamedTuple):
    """What a rollout did in its steps: (step, ...) [m], [m/s], [m/s²]."""

    position: Tensor
    speed: Tensor
    acceleration: Tensor


Error = Callable[[Motion], Tensor]
"""One number, of where everybody was after each step."""


def backward(
    model: TorchPredictor, assignment: Tensor, rollout: Rollout, error: Error, gap_error: Error | None
) -> float:
    """Adds the gradients of errors to the weights of the model's networks; returns the driver's error.

    A gap decision is 0 or 1 and has no gradient. So the acceleration counts as if it went from that of waiting to that
    of going with the probability of accepting all open gaps.

    Args:
        model: the networks, bound to the moments.
        assignment: int8 (moment, pair), completed already.
        rollout: what the core predicts with these networks.
        error: of the motion, from which the driver has its gradients.
        gap_error: that from which the gap network has its own; None: it has none.
    """
    begin = Rollout(*(one[:-1] for one in rollout))
    with torch.no_grad():
        seen = model.seen(begin.position, begin.speed, begin.present)
    steps = _Steps.of(model, begin, seen)
    value, effect = _effects(rollout, seen, steps, error)
    total = (effect[steps.where] * steps.acceleration).sum()
    if gap_error is not None:
        _, effect = _effects(rollout, seen, steps, gap_error)
        total = total + (effect * _by_acceptance(model, assignment, begin, seen, steps)).sum()
    total.backward()  # type: ignore[no-untyped-call]
    return value


class _Steps(NamedTuple):
    """Of all vehicles present, in one row; where: their steps, moments and indices.

    acceleration: with gradients of the weights. by_...: how it depends on the own position and speed and on the lead's.
    otherwise: what it would be with the other decision.
    """

    where: tuple[Tensor, Tensor, Tensor]
    acceleration: Tensor
    by_position: Tensor
    by_speed: Tensor
    by_lead_position: Tensor
    by_lead_speed: Tensor
    otherwise: Tensor

    @classmethod
    def of(cls, model: TorchPredictor, begin: Rollout, seen: Seen) -> _Steps:
        """Those of a rollout, from the states at which its steps begin."""
        step, moment, vehicle = where = begin.present.nonzero(as_tuple=True)
        known, place = model.vehicles, (moment, vehicle)
        lead = seen.lead[where]
        beside = (moment, vehicle, lead)
        further = seen.further[where]
        position, speed = (one[where].requires_grad_(True) for one in begin[:2])
        lead_position, lead_speed = (one[step, moment, lead].requires_grad_(True) for one in begin[:2])
        limit, headings = model.tables.road(known.route[place], position)
        follows = seen.view.to_lead[where] < LEAD_RANGE
        gap = lead_position - further - position - model.half_lengths[beside]
        view = View(
            model.stop_line[place] - known.half_length[place] - position,
            speed,
            torch.minimum(limit, known.max_speed[place]),
            headings,
            torch.where(follows, gap, LEAD_RANGE),
            torch.where(follows, lead_speed, FREE_LEAD_SPEED),
        )
        enters, top_speed = begin.enters[where], known.max_speed[place]
        acceleration = model.networks.drive(view, enters, max_speed=top_speed)
        inputs = [position, speed, lead_position, lead_speed]
        slopes = torch.autograd.grad(acceleration.sum(), inputs, retain_graph=True)
        with torch.no_grad():
            otherwise = model.networks.drive(view, ~enters, max_speed=top_speed)
        return cls._make((where, acceleration, *slopes, otherwise))

    def spread(self, values: Tensor, like: Tensor) -> Tensor:
        """One of the rows as (step, moment, vehicle), 0 for who is not present."""
        return torch.zeros_like(like).index_put(self.where, values)


def _effects(rollout: Rollout, seen: Seen, steps: _Steps, error: Error) -> tuple[float, Tensor]:
    """The error, and how much it grows with the acceleration of each vehicle in each step: (step, moment, vehicle)."""
    applied = (rollout.speed[1:] - rollout.speed[:-1]) / DT
    value, of = error_by_motion(Motion(rollout.position[1:], rollout.speed[1:], applied), error)
    moves = rollout.present[:-1]
    acceleration, *slopes = (steps.spread(one.detach(), of.position) for one in steps[1:6])
    takes_effect = moves & (rollout.speed[:-1] + DT * acceleration >= 0.0)
    return value, effects_of_accelerations(of, takes_effect, slopes, moves, seen.lead)


def error_by_motion(motion: Motion, error: Error) -> tuple[float, Motion]:
    """The error of a motion, and how much it grows with each part of that."""
    parts = Motion(*(one.clone().requires_grad_(True) for one in motion))
    value = error(parts)
    return float(value.detach()), Motion(*torch.autograd.grad(value, list(parts), materialize_grads=True))


def effects_of_accelerations(
    of: Motion, takes_effect: Tensor, slopes: Sequence[Tensor], moves: Tensor, lead: Tensor | None
) -> Tensor:
    """How much an error grows with each acceleration, what follows from it included: (step, ...).

    Args:
        of: how much it grows with each part of the motion by itself.
        takes_effect: (step, ...) bool, whether the acceleration is that of the motion, as who stands brakes no more.
        slopes: (step, ...) each, how accelerations depend on the own position and speed and, where there are leads, on
            the lead's.
        moves: (step, ...) bool, who is there.
        lead: (step, ..., vehicle) who leads whom; None: nobody.
    """
    position, speed = torch.zeros_like(of.position[0]), torch.zeros_like(of.position[0])
    effects = torch.zeros_like(of.position)
    for step in reversed(range(len(effects))):
        position, speed = position + of.position[step], speed + of.speed[step]
        # v' = max(0, v + DT a), p' = p + DT / 2 (v + v'), the acceleration that counts is (v' - v) / DT
        next_speed = speed + 0.5 * DT * position + of.acceleration[step] / DT
        effect = torch.where(takes_effect[step], DT * next_speed, 0.0)
        effects[step] = effect
        kept = torch.where(takes_effect[step], next_speed, 0.0) + 0.5 * DT * position - of.acceleration[step] / DT
        speed = torch.where(moves[step], kept + effect * slopes[1][step], speed)
        position = position + effect * slopes[0][step]
        if lead is not None:
            position = position.scatter_add(-1, lead[step], effect * slopes[2][step])
            speed = speed.scatter_add(-1, lead[step], effect * slopes[3][step])
    return effects


def _by_acceptance(model: TorchPredictor, assignment: Tensor, begin: Rollout, seen: Seen, steps: _Steps) -> Tensor:
    """0 everywhere, with the gap network's gradients: of what going instead of waiting changes, where that is open."""
    remembered = torch.cat([model.vehicles.delta.expand(begin.enters[:1].shape), begin.enters[:-1]])
    stopped = model.at_stop(seen).cummax(0).values | model.vehicles.stopped
    pairs = model.pairs(assignment, seen, begin.position, begin.present, remembered, stopped)
    chosen = pairs.free.nonzero(as_tuple=True)
    logit = torch.zeros(pairs.free.shape).index_put(chosen, model.networks.gap(pairs.gap[chosen]))
    with torch.no_grad():
        open_ = _open(model, begin, seen, pairs, logit)
        otherwise = steps.spread(steps.otherwise - steps.acceleration, begin.position)
        gained = torch.where(begin.enters, -otherwise, otherwise)
        gained = torch.where(pairs.told | pairs.kept | pairs.settled | pairs.stops, 0.0, gained)
    log = torch.where(open_, logsigmoid(logit), 0.0)
    accepts = torch.zeros_like(begin.position).scatter_add(-1, pairs.i, log).exp()
    return gained * (accepts - accepts.detach())


def _open(model: TorchPredictor, begin: Rollout, seen: Seen, pairs: Pairs, logit: Tensor) -> Tensor:
    """(step, moment, pair), whose gap counted: who is held is known step by step only."""
    hold = torch.full(begin.enters.shape[1:], -1)
    every = []
    for step in range(len(begin.enters)):
        now = Seen(View(*(one[step] for one in seen.view)), *(one[step] for one in seen[1:]))
        own = Pairs(*(one[step] for one in pairs))
        held = model.held(own, logit[step], hold)
        hold = model.next_hold(now, own, held, begin.enters[step], hold)
        every.append(held.open)
    return torch.stack(every)
