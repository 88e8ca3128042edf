"""Which form of the projection a record's sampling calls for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.prepared import Prepared
from pipeline.projection.solve import ITERATIONS, Problem, ProjectionFit, fit_projection
from pipeline.projection.uniform import UniformProblem, response_constants

MOST_ANGLE = 0.5 * np.pi  # swing between samples up to which the eight-point quadrature holds
FINE_ANGLE = 0.8  # swing between samples of the finer grid that marks are brought to


def linear_fit(prepared: Prepared, *, bridged: bool = False, rounds: int = ITERATIONS) -> ProjectionFit:
    """The linear identity fitted to a record, the damping held where it is stated; see `fit_projection`.

    Long gaps of the first pendulum are cut out, unless `bridged`: as an exact inversion must, beside which it is held.
    """
    start = prepared.rough
    free = prepared.known_damping is None
    if bridged or not prepared.long_gaps:
        return fit_projection(problem(prepared), start.frequency, start.damping_rate, free, rounds)
    from pipeline.projection.cuts import cuts

    spans = cuts(prepared, _factor(prepared))
    seen = prepared.observation
    gain = response_constants(start.frequency, start.damping_rate, seen.frequency_ratio, seen.damping_difference)[2]
    # the amplitudes are those at the start of the record, from where they have decayed
    steps = [abs(gain) * span.spread * np.exp(start.damping_rate * span.end) for span in spans]
    parted = problem(prepared, [(span.begin, span.end) for span in spans])
    return fit_projection(parted, start.frequency, start.damping_rate, free, rounds, np.array(steps))


def problem(prepared: Prepared, cut: Sequence[tuple[float, float]] = ()) -> Problem:
    """Uniform samples as they are, marks on a finer grid of the first pendulum, uneven samples by interpolation."""
    seen = prepared.observation
    constants = (prepared.nominal, seen.frequency_ratio, seen.damping_difference)
    if seen.step is None:
        from pipeline.projection.uneven import UnevenProblem

        return UnevenProblem(seen.time, prepared.whole, prepared.whole_step, seen.difference, *constants, cut)
    factor = _factor(prepared)
    if factor == 1:
        return UniformProblem(prepared.whole, seen.difference, seen.step, *constants, cut)
    theta = prepared.finer(seen.step, factor)
    difference = np.full(theta.size, np.nan)
    difference[::factor] = seen.difference
    return UniformProblem(theta, difference, seen.step / factor, *constants, cut)


def _factor(prepared: Prepared) -> int:
    """How many times finer than the readings the first pendulum's grid must be."""
    angle = prepared.whole_step * prepared.nominal
    return 1 if angle <= MOST_ANGLE else int(np.ceil(angle / FINE_ANGLE))
