"""Gravity along the track: a cubic spline on even knots, with a prior that is smooth in time."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.constants import Constant, Constants, Solution, solve, spline

KNOTS, SPACINGS = (4, 24, 64), (60.0, 600.0)  # least, most of a short record, most; s: least, and most of a short one
SIZES = 1e-6 * np.array([0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0])
"""Root mean squares of the change over reference gravity that are tried: .3 to 300 mGal."""
IN_GAP = "motion in the gap"  # of a constant's name: it acts as gravity does, and is none
LENGTHS = np.array([0.1, 0.3, 1.0])  # Correlation times that are tried, of the record's length


@dataclass(frozen=True)
class Course:
    """Prior of a course: Gaussian, squared-exponential in time."""

    size: float  # Root mean square over reference gravity
    length: float  # Correlation time, s


def knots(duration: float) -> Constants:
    """Constants of a course, one a knot; one lies outside on either side."""
    least, many, most = KNOTS
    count = int(np.clip(max(min(duration / SPACINGS[0], many), 3.0 + duration / SPACINGS[1]), least, most))
    spacing = duration / (count - 3)
    return tuple(
        Constant(f"course {k}", kinds.GRAVITY, 1e-15, centre=(k - 1) * spacing, width=spacing) for k in range(count)
    )


def is_knot(constant: Constant) -> bool:
    """Whether a constant is one of a course."""
    return constant.kind == kinds.GRAVITY and constant.width > 0.0 and not constant.name.startswith(IN_GAP)


def prior_root(constants: Constants, course: Course | None) -> Floats:
    """Root of the covariance of all priors; of a course that is not assumed next to nothing is left."""
    root = np.diag([each.prior for each in constants])
    rows = [k for k, each in enumerate(constants) if is_knot(each)]
    if course is not None and rows:
        at = np.array([constants[k].centre for k in rows])
        apart = (at[:, None] - at) / course.length
        covariance = course.size**2 * (np.exp(-0.5 * apart**2) + 1e-6 * np.eye(at.size))
        root[np.ix_(rows, rows)] = np.linalg.cholesky(covariance)
    return root


def best_course(constants: Constants, normal: Floats, totals: Floats, duration: float) -> tuple[Course, Solution]:
    """The prior that the likelihood likes best, from the normal matrix of one pass."""
    of = constants, normal, float(totals[0]), float(totals[1])
    priors = (Course(float(size), float(part * duration)) for size, part in product(SIZES, LENGTHS))
    trials = ((course, solve(*of, prior_root(constants, course))) for course in priors)
    return max(trials, key=lambda trial: trial[1].log_likelihood)


def weights(constants: Constants, times: Floats) -> Floats:
    """Rows that give gravity over reference gravity at times since the first node, (n, c)."""
    out = np.zeros((times.size, len(constants)))
    for k, each in enumerate(constants):
        if is_knot(each) or (each.kind == kinds.GRAVITY and each.width == 0.0):
            out[:, k] = 1.0 if each.width == 0.0 else spline(times, each)
    return out


def mean_gravity(solution: Solution, duration: float) -> tuple[float, float]:
    """Mean of gravity over the record over reference gravity, and its 1 sigma."""
    row = mean_row(solution, duration)
    values = np.array([each.value for each in solution.constants])
    return float(row @ values), float(np.sqrt(row @ solution.covariance @ row))


def mean_row(solution: Solution, duration: float) -> Floats:
    """Row that gives this mean from the constants, (c,)."""
    return np.asarray(weights(solution.constants, np.linspace(0.0, duration, 512)).mean(axis=0))
