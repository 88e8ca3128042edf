"""Random kicks of the pendulums: how large the likelihood wants them, beside other things and alone."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import motion
from pipeline.joint.explanation import PAYS, Candidate, Fitted, attempted, path_on, priced

SIZES = 8  # each three times the one before
NOTICED, ABSENT, SAME, THRICE = 2.5, 2.0, 0.5, 3.0  # of gravity's sigma; in log-likelihood; a step of sizes


def larger_or_smaller(fit: Fitted, *, asked: bool = False) -> Iterator[Candidate]:
    """Kicks that a fit does not have, or others, each for a pass; those that gravity hardly notices if `asked` for."""
    model = fit.model
    now, words = model.assumed.kick, tuple(word for word in model.words if word != "kicks")

    def of(kick: Floats) -> Candidate:
        named = (*words, "kicks") if kick.any() else words
        trial = replace(model, words=named, assumed=replace(model.assumed, kick=kick))
        return priced(trial, fit.path, cost=1.0 if kick.any() else -PAYS)

    if not np.any(now):
        best = of(np.full(now.size, noticed(fit)))
        yield best
        if not asked and best.value < fit.solution.log_likelihood - ABSENT:
            return
        less = best.value + 1.0 < fit.solution.log_likelihood  # likelihoods fall on: larger ones explain nothing
        for factor in (1.0 / THRICE,) if less else (THRICE, 1.0 / THRICE):
            begun = best
            while (found := of(best.model.assumed.kick * factor)).value > best.value + SAME:
                yield found
                best = found
            yield found
            if best is not begun:
                break
        if best.value > fit.solution.log_likelihood:
            yield from (of(each * best.model.assumed.kick) for each in np.eye(now.size))
        return
    for i in range(now.size):
        for factor in (0.1, 0.5, 2.0):
            kick = now.copy()
            kick[i] *= factor
            yield of(kick)
    for factor in (0.0, 0.6, 1.7):
        yield of(now * factor)


def noticed(fit: Fitted) -> float:
    """Kicks of all pendulums that would make gravity a few times less certain than it is, rad s-1/2: the slope of a
    phase that wanders by k/a is uncertain by .77 k/(a sqrt(T)) of the frequency."""
    problem = fit.model.problem
    arc = float(np.sqrt(2.0) * np.std(fit.path[:, : 2 * problem.pendulums : 2]))
    return NOTICED * fit.gravity[1] * problem.swing * arc * float(np.sqrt(problem.lattice.duration)) / (2.0 * 0.77)


def alone(fit: Fitted) -> Fitted | None:
    """A fit with kicks of all pendulums, or of one, as large as the likelihood asks for, on its ship or a level one."""
    model, pendulums, found = fit.model, fit.model.problem.pendulums, []
    level, begun = (
        tuple(each for each in ship if each.axis != "vertical") for ship in (model.assumed.ship, model.begun)
    )
    for which in (np.ones(pendulums), *np.eye(pendulums)):
        best, last, size = Candidate(-np.inf, model, fit.solution), -np.inf, noticed(fit)
        for _ in range(SIZES):
            for ship, first in {level: begun, model.assumed.ship: model.begun}.items():
                assumed = replace(model.assumed, ship=ship, kick=size * which)
                trial = priced(model.adding("kicks", assumed=assumed, begun=first), path_on(fit, ship))
                best = max(best, trial, key=lambda one: one.value)
            if best.value == last:
                break
            last, size = best.value, THRICE * size
        kicked = attempted(best.model, path_on(fit, best.model.assumed.ship))
        if kicked is not None:
            kicked = motion.reshaped(kicked)
            other = max(larger_or_smaller(kicked), key=lambda one: one.value)  # on the ship that goes with them
            more = attempted(other.model, kicked.path) if other.value >= kicked.solution.log_likelihood else kicked
            found += [] if more is None else [more]
    return max(found, key=lambda one: one.solution.log_likelihood, default=None)
