"""Which form of the projection a record's sampling calls for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Floats
from pipeline.prepared import Prepared
from pipeline.projection.solve import ITERATIONS, Problem, ProjectionFit, fit_projection
from pipeline.projection.uniform import UniformProblem, response_constants

MOST_ANGLE = 0.5 * np.pi  # swing between readings up to which neighbours tell the motion between them
FINE_ANGLE = 0.8  # swing between points of the grid, at most: eight points a swing
FEW_A_SWING = 27, 15.6
"""Reach, readings, and shape of the window by which a first pendulum read four to eight times a swing is interpolated:
150 dB from 0.81 of the Nyquist frequency, which is 1.6 times the swing's or more, to its mirror image (Kaiser 1974)."""


def linear_fit(prepared: Prepared, *, bridged: bool = False, rounds: int = ITERATIONS) -> ProjectionFit:
    """The linear identity fitted to a record, the damping held where it is stated; see `fit_projection`.

    Long gaps of the first pendulum are cut out, unless `bridged`: as an exact inversion must, beside which it is held.
    """
    start = prepared.rough
    free = prepared.known_damping is None
    if bridged or not prepared.long_gaps:
        return fit_projection(problem(prepared), start.frequency, start.damping_rate, free, rounds)
    from pipeline.projection.cuts import MARGIN, cuts
    from pipeline.projection.upsample import FILTER_REACH

    factor = steps_between(prepared)
    spans = cuts(prepared, factor if at_marks(prepared) else 1, MARGIN if factor == 1 else FILTER_REACH)
    seen = prepared.observation
    gain = response_constants(start.frequency, start.damping_rate, seen.frequency_ratio, seen.damping_difference)[2]
    # the amplitudes are those at the start of the record, from where they have decayed
    steps = [abs(gain) * span.spread * np.exp(start.damping_rate * span.end) for span in spans]
    parted = problem(prepared, [(span.begin, span.end) for span in spans])
    return fit_projection(parted, start.frequency, start.damping_rate, free, rounds, np.array(steps))


def problem(prepared: Prepared, cut: Sequence[tuple[float, float]] = ()) -> Problem:
    """Uniform samples on the grid of the first pendulum, uneven samples by interpolation."""
    seen = prepared.observation
    constants = (prepared.nominal, seen.frequency_ratio, seen.damping_difference)
    if seen.step is None:
        from pipeline.projection.uneven import UnevenProblem

        return UnevenProblem(seen.time, prepared.whole, prepared.whole_step, seen.difference, *constants, cut)
    theta, factor = first_pendulum(prepared)
    if factor == 1:
        return UniformProblem(theta, seen.difference, seen.step, *constants, cut)
    difference = np.full(theta.size, np.nan)
    difference[::factor] = seen.difference
    return UniformProblem(theta, difference, seen.step / factor, *constants, cut)


def first_pendulum(prepared: Prepared) -> tuple[Floats, int]:
    """The first pendulum on the grid on which the identities are solved, rad, and its steps in one between readings.

    Where the swing turns far from reading to reading the grid is finer: between four and eight readings a swing by a
    sinc, at marks by the envelope of minutes.
    """
    factor = steps_between(prepared)
    if factor == 1:
        return prepared.whole, 1
    if at_marks(prepared):
        return prepared.finer(prepared.whole_step, factor), factor
    from pipeline.projection.upsample import interpolated

    return interpolated(prepared.whole, factor, *FEW_A_SWING), factor


def steps_between(prepared: Prepared) -> int:
    """Steps of that grid in one between readings."""
    return max(1, int(np.ceil(prepared.whole_step * prepared.nominal / FINE_ANGLE)))


def at_marks(prepared: Prepared) -> bool:
    """Whether the swing was read so seldom that neighbours tell nothing of the motion between them."""
    return prepared.whole_step * prepared.nominal > MOST_ANGLE
