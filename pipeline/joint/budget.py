"""What gravity's variance is made of, and what gravity would lack if the apparatus were taken as perfect.

Gravity is a generalised least-squares estimate, w'y: its variance is the sum of what each independent source brings,
and to first order the weights do not change with the sources. A constant with a prior of variance P, whose posterior
covariance with gravity is C, brings C^2/P; noise brings the derivative of the variance by the logarithm of its own.
"""

import math
from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.conditions import MGAL
from pipeline.joint import kinds
from pipeline.joint.constants import is_mode
from pipeline.joint.course import is_knot, mean_row, prior_root
from pipeline.joint.explanation import Fitted, priced
from pipeline.joint.problem import LEVEL, Assumed
from pipeline.ledger.own import CLOCK_STEPS, SCALE, ZERO

LARGER = 1.1  # a noise, for its share
SOURCES = {
    **dict.fromkeys((kinds.RATIO, kinds.SWAY), "ratio"),
    **dict.fromkeys((kinds.DAMPING, kinds.QUADRATIC, kinds.DRY, kinds.FADE), "damping"),
    **dict.fromkeys((kinds.ZERO, kinds.STEP, kinds.DRIFT), "zero"),
    **dict.fromkeys((kinds.GAIN, kinds.CUBIC, kinds.CROSS), "scale"),
    **dict.fromkeys((kinds.DELAY, kinds.CLOCK), "clock"),
    **dict.fromkeys((kinds.HEAVE_SCALE, kinds.HEAVE_DELAY, kinds.READ_HEAVE_SCALE, kinds.READ_HEAVE_DELAY), "heave"),
    kinds.KNOCK: "kicks",
}  # Of a constant's uncertainty
ENTRIES = {SCALE.NAME: kinds.GAIN, CLOCK_STEPS.NAME: kinds.CLOCK}  # Of the ledger, and the constants that make them up
PLACES = 256  # moments at which a zero that drifts or steps is squared


def shares(fit: Fitted, whole: float) -> dict[str, float]:
    """Shares of each source in the variance of mean gravity; `whole`: that over gravity's square, with all doubts."""
    constants, covariance = fit.solution.constants, fit.solution.covariance
    row = mean_row(fit.solution, fit.model.problem.lattice.duration)
    along = row @ covariance
    found: dict[str, float] = {}
    for each, of in zip(constants, along.tolist(), strict=True):
        if each.kind in SOURCES:
            found[SOURCES[each.kind]] = found.get(SOURCES[each.kind], 0.0) + (of / each.prior) ** 2
    own = float(along @ row)
    if any(is_knot(each) for each in constants):
        rows = [k for k, each in enumerate(constants) if is_knot(each)]
        root = prior_root(constants, fit.model.course)[np.ix_(rows, rows)]
        found["course"] = float(np.sum(np.linalg.solve(root, along[rows]) ** 2))
    left, assumed = max(own - sum(found.values()), 0.0), fit.model.assumed
    kicked = _of_noise(fit, row, own, replace(assumed, kick=LARGER * assumed.kick)) if assumed.kick.any() else 0.0
    read = _of_noise(fit, row, own, replace(assumed, noise=LARGER * assumed.noise))
    scale = min(1.0, left / max(kicked + read, 1e-300))
    found["kicks"] = found.get("kicks", 0.0) + scale * kicked
    found["reading"] = scale * read
    found["heave"] = found.get("heave", 0.0) + left - scale * (kicked + read)
    found["model"] = max(whole - own, 0.0)
    total = sum(found.values())
    return {name: value / total for name, value in found.items() if value > 0.0}


def _of_noise(fit: Fitted, row: Floats, variance: float, larger: Assumed) -> float:
    """What a noise brings, from the variance where it is a little larger."""
    covariance = priced(replace(fit.model, assumed=larger), fit.path).solution.covariance
    if not covariance.size:  # it cannot be followed
        return 0.0
    growth = math.log(float(row @ covariance @ row) / variance)
    return variance * min(max(growth / (2.0 * math.log(LARGER)), 0.0), 1.0)


def parts(fit: Fitted, reference: float) -> dict[str, tuple[float, float, str]]:
    """Entries of the ledger that zeros, scales and clock steps make up: value and 1 sigma, mGal, and words."""
    constants, covariance = fit.solution.constants, fit.solution.covariance
    along = mean_row(fit.solution, fit.model.problem.lattice.duration) @ covariance
    found = _zero(fit, reference)
    for name, of in ENTRIES.items():
        some = [k for k, each in enumerate(constants) if each.kind == of and not is_mode(each)]
        if some:
            own = covariance[np.ix_(some, some)]
            lever = np.linalg.lstsq(own, along[some], rcond=None)[0]
            value = float(lever @ [constants[k].value for k in some])
            sigma = float(np.sqrt(max(float(lever @ own @ lever), 0.0)))
            words = "; ".join(f"{constants[k].name} {constants[k].value:.3g}" for k in some)
            found[name] = (reference * value / MGAL, reference * sigma / MGAL, words)
    return found


def _zero(fit: Fitted, reference: float) -> dict[str, tuple[float, float, str]]:
    """Of the traces that see the ship: what lies beside the vertical strengthens gravity as a slow motion does."""
    problem, solution = fit.model.problem, fit.solution
    times = np.linspace(0.0, problem.lattice.duration, PLACES)
    level = np.flatnonzero(np.abs(problem.lattice.combination.sum(axis=1)) > LEVEL)
    zero, sigma, words = np.zeros((problem.traces, PLACES)), 0.0, []
    for k, each in enumerate(solution.constants):
        if each.kind in (kinds.ZERO, kinds.DRIFT, kinds.STEP) and each.index in level:
            shape = {kinds.DRIFT: (times - each.centre) / (each.width or 1.0), kinds.STEP: 1.0 * (times >= each.centre)}
            zero[each.index] += each.value * shape.get(each.kind, np.ones(PLACES))
            sigma += abs(each.value) * float(np.sqrt(solution.covariance[k, k]))
            words.append(f"{each.name} {each.value:.3g}")
    if not words:
        return {}
    value = 0.5 * reference * float(np.mean(zero[level] ** 2))
    return {ZERO.NAME: (value / MGAL, reference * sigma / MGAL, "; ".join(words))}
