"""The cold start: a swing followed over longer and longer stretches, under a generous ship."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import apparatus, explanation, kinds
from pipeline.joint.constants import Constant, starts
from pipeline.joint.gather import Gathered
from pipeline.joint.outliers import COARSE_GATE, GATE, MOST_FITS, deviation, smoothed
from pipeline.joint.problem import LEAST_NOISE, NO_PATH, SPARSE, Assumed, Problem
from pipeline.joint.ship import Component, Sea, Vibration

STAGES = (25.0, 100.0, 400.0)  # s: stretches on which a cold start is followed
EARTH = 0.004  # 1 sigma of gravity over reference gravity in a cold start
DAMPING, DIFFERENCE = 1e-3, 1e-4  # s-1: 1 sigma of an unstated rate, and of its difference between pendulums
WIDE = 2.0  # 1 sigma of a pendulum's start over the largest readings
COARSE = 0.1  # reading noise of a cold start's first stretch, of the swing
MOST_OUTLIERS = 0.1  # share of the readings of a cold start
UNSTATED = 1e-4  # rad: reading noise of a cold start where none is stated
ACCELEROMETER = 3e-5  # over reference gravity: noise of a recorded acceleration that is too sparse to be interpolated
GENEROUS = (Sea(0.9, 0.45, 0.03), Vibration(6.0, 1e-3))  # The ship's motion that a cold start allows for
CAPTURE = 0.02  # of gravity, from the reference
ROUGH_KICK, KICK = 1e-5, 3e-6  # rad s-1/2, of pendulums that are followed at first


def first_constants(gathered: Gathered) -> tuple[Constant, ...]:
    """Gravity, damping and the start of the free swing, with their priors."""
    problem = gathered.problem
    frequency = np.sqrt(problem.kappa)
    arc = WIDE * float(np.quantile(np.abs(problem.lattice.value[~problem.left_out]), 0.99))
    found = list(starts(problem.pendulums, frequency, arc=arc))
    found.append(Constant("gravity", kinds.GRAVITY, 0.02, mean=1.0, value=1.0))
    found += apparatus.constants(problem, gathered.constants)
    if gathered.constants["damping_rate"] is None:
        found.append(Constant("damping", kinds.DAMPING, DAMPING))
        found += [Constant(f"damping of {i}", kinds.DAMPING, DIFFERENCE, i) for i in range(1, problem.pendulums)]
    elif "damping_rate_uncertainty" in gathered.constants["constants"]:
        spread = np.broadcast_to(gathered.constants["constants"]["damping_rate_uncertainty"], problem.kappa.shape)
        found += [
            Constant(f"damping of {i}", kinds.DAMPING, float(s), i, stated=True)
            for i, s in enumerate(spread)
            if s > 0.0
        ]
    return tuple(found)


def held(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Gravity and damping held where they are."""
    stiff = (kinds.DAMPING, kinds.GRAVITY)
    return tuple(replace(c, prior=1e-15, mean=c.value) if c.kind in stiff else c for c in constants)


def released(constants: tuple[Constant, ...], like: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Values of the first, priors of the second; what the first has more stays."""
    found = tuple(replace(b, value=a.value) for a, b in zip(constants, like, strict=False))
    return (*found, *constants[len(like) :])


def narrowed(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Gravity within what the Earth has, damping held where it is."""
    return tuple(replace(c, prior=EARTH) if c.kind == kinds.GRAVITY else held((c,))[0] for c in constants)


def cold_start(problem: Problem, assumed: Assumed, first: tuple[Constant, ...]) -> explanation.Fitted:
    """Follow the swing over longer and longer stretches, each linear enough for the one before it.

    They are read as if they were noisier: the ship's motion would else be made to explain what a wrong gravity leaves.
    """
    constants = first
    step, nodes = problem.lattice.step, problem.lattice.nodes
    size = float(np.std(problem.lattice.value[~problem.left_out]))
    still = replace(assumed, ship=tuple(c for c in assumed.ship if c.axis != "vertical"))
    # readings that fall on one phase of the swing show the other only after a while
    between = float(np.median(np.diff(np.unique(problem.lattice.node)))) * step * problem.swing
    for number, seconds in enumerate(STAGES if between < SPARSE else STAGES[1:]):
        end = int(min(nodes, np.ceil(seconds / step)))
        part = problem.until(end)
        rough = replace(still, noise=np.maximum(assumed.noise, size * COARSE / 5.0 ** min(number, 2)))
        if number == 0:
            easy = replace(rough, sine=False, noise=np.maximum(rough.noise, size))
            constants = released(part.run(easy, held(constants))[0].constants, first)
        constants, errors = followed(part, rough, narrowed(constants))
        constants = released(constants, first)
        if end == nodes:
            break
    # what shakes one trace all along is not wild
    scatter = [deviation(errors[part.lattice.trace == j]) for j in range(rough.noise.size)]
    rough = replace(rough, kick=assumed.kick + ROUGH_KICK, noise=rough.noise * scatter)
    return smoothed(problem, rough, narrowed(constants), NO_PATH, 2.0 * GATE, most=1)


def again(begun: explanation.Fitted) -> explanation.Fitted:
    """The same about its own path, to the end; what is wild or broken shows on the way."""
    model = begun.model
    gate = GATE * deviation(begun.of.errors)
    return smoothed(model.problem, model.assumed, model.constants, begun.path, gate)


def mirrored(begun: explanation.Fitted) -> list[explanation.Fitted]:
    """The same readings by the swing that even, sparse times show as well; none where that is far from the stated."""
    model, constants = begun.model, begun.model.constants
    gravity = next(each.value for each in constants if each.kind == kinds.GRAVITY)
    own = float(np.sqrt(model.problem.kappa.mean() * gravity))
    between = float(np.median(np.diff(np.unique(model.problem.lattice.time))))
    half_turns = np.rint(own * between / np.pi)
    factor = 2.0 * np.pi / between * half_turns / own - 1.0
    if not half_turns or abs(gravity * factor**2 - 1.0) > CAPTURE:
        return []
    by = {kinds.GRAVITY: factor**2, kinds.START: -factor}
    constants = tuple(
        replace(each, value=each.value * by[each.kind])
        if each.kind == kinds.GRAVITY or (each.kind == kinds.START and each.index % 2)
        else each
        for each in constants
    )
    return [smoothed(model.problem, model.assumed, constants, NO_PATH)]


def followed(
    problem: Problem, assumed: Assumed, constants: tuple[Constant, ...]
) -> tuple[tuple[Constant, ...], Floats]:
    """Gauss-Newton without readings far off as long as they are few; and all errors, (r,)."""
    gate = COARSE_GATE
    for _ in range(MOST_FITS):
        solution, of = problem.run(assumed, constants, gate=gate)
        share = float(of.totals[2] / max(of.totals[1] + of.totals[2], 1.0))
        gate = GATE * deviation(of.errors) if share < MOST_OUTLIERS else 0.0
        constants = solution.constants
        if share < MOST_OUTLIERS and np.all(np.abs(solution.step) < 0.1 * np.sqrt(np.diag(solution.covariance))):
            break
    return constants, of.errors


@dataclass(frozen=True)
class Begun:
    """A law with its cold start."""

    gathered: Gathered
    assumed: Assumed
    first: tuple[Constant, ...]  # With their priors
    rough: explanation.Fitted

    @staticmethod
    def of(gathered: Gathered, *, sine: bool) -> list[Begun]:
        """Follow the swing from a cold start; and the one that even, sparse times show as well."""
        problem = gathered.problem
        stated = np.where(np.isfinite(gathered.noise), gathered.noise, UNSTATED)
        noise = np.concatenate([np.maximum(stated, LEAST_NOISE), [ACCELEROMETER, ACCELEROMETER]])
        ship: tuple[Component, ...] = GENEROUS
        if problem.leaves_heave_open(sine):
            ship = (*ship, replace(GENEROUS[0], axis="vertical"))
        if gathered.tilts:
            ship = (*ship, replace(GENEROUS[0], axis="tilt"))
        assumed = Assumed(ship, np.zeros(problem.pendulums), noise, sine, gathered.heave_noise)
        first = first_constants(gathered)
        rough = cold_start(problem, assumed, first)
        others = mirrored(rough)
        found = [again(rough), *others] if others else [rough]
        return [Begun(gathered, assumed, first, each) for each in found]
