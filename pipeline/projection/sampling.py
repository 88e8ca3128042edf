"""Which form of the projection a record's sampling calls for."""

from __future__ import annotations

import numpy as np

from pipeline.prepared import Prepared
from pipeline.projection.solve import Problem, ProjectionFit, UniformProblem, fit_projection

MOST_ANGLE = 0.5 * np.pi  # swing between samples up to which the eight-point quadrature holds
FINE_ANGLE = 0.8  # swing between samples of the finer grid that marks are brought to


def linear_fit(prepared: Prepared, **options: int) -> ProjectionFit:
    """The linear identity fitted to a record, the damping held where it is stated; see `fit_projection`."""
    start = prepared.rough
    free = prepared.known_damping is None
    return fit_projection(problem(prepared), start.frequency, start.damping_rate, free, **options)


def problem(prepared: Prepared) -> Problem:
    """Uniform samples as they are, marks on a finer grid of the first pendulum, uneven samples by interpolation."""
    seen = prepared.observation
    constants = (prepared.nominal, seen.frequency_ratio, seen.damping_difference)
    if seen.step is None:
        from pipeline.projection.uneven import UnevenProblem

        return UnevenProblem(seen.time, prepared.whole, prepared.whole_step, seen.difference, *constants)
    if seen.step * prepared.nominal <= MOST_ANGLE:
        return UniformProblem(prepared.whole, seen.difference, seen.step, *constants)
    factor = int(np.ceil(seen.step * prepared.nominal / FINE_ANGLE))
    theta, _ = prepared.finer(seen.step, factor)
    difference = np.full(theta.size, np.nan)
    difference[::factor] = seen.difference
    return UniformProblem(theta, difference, seen.step / factor, *constants)
