"""From a prepared record to its nonlinear inversion: the grid, the linear start, heave where it shows, the error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from data_schemas.scratch import by_portions, portions, room
from pipeline.arrays import Floats, readings, sum_of_squares
from pipeline.harmonics.envelope import fill
from pipeline.inversion import kernels
from pipeline.inversion.influence import theta_influence
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.motion import Grid, Motion, Readings
from pipeline.inversion.solve import InversionFit, fit_inversion
from pipeline.methods.phases import passes_zero
from pipeline.methods.projection import residual_colour
from pipeline.prepared import Prepared, slow_variance
from pipeline.projection.sampling import at_marks, first_pendulum, linear_fit
from pipeline.projection.solve import ProjectionFit

BETWEEN_MARKS = (1e-3, 1e-2)
"""Shares of what sway and recorded heave do to n2 that are lost where the first pendulum is read twice a swing: between
marks its swing is told from minutes, and what modulates it within seconds is not. Measured on simulated records."""
LEAST_COLOUR = 0.3  # of white noise at half-second marks it is 0.5 to 1
HEAVE_RATE = 1.0  # rad s-1, the fastest heave that is reckoned with where it can only be guessed at
NOISY = 3e-4  # reading noise of the first pendulum over its swing, from which its third harmonic is better reckoned
HEAVE_COLOUR = 3.0  # power of the residual near the swing over white from which heave is looked for
HEAVE_EXCESS = 2.0  # residual over the reading noise from which it is looked for as well
HEAVE_FLOOR = 1e-5  # of the amplitude: a smaller residual shows no heave
RIPPLE, COARSE, COARSE_UNEVEN, ORDER = 3e-9, 5e-6, 5e-3, 8
"""Numerical error, in parts of the strength of the nonlinear terms: the filters' ripple, and the quadrature's, which
grows with that power of the swing's turn between readings, a thousand times as large at uneven times; measured on
simulated records (five motions, six rates)."""


@dataclass(frozen=True)
class Inverted:
    """What the nonlinear inversion found.

    Attributes
    ----------
    frequency, damping_rate : float
        n2 at infinitesimal arc, rad s-1; gamma2, s-1.
    sigma : float
        1-sigma of n2 from the noise of both traces and from the numerical method, rad s-1.
    noise, colour : float
        1-sigma residual, rad; its power near the swing over that of white noise.
    samples : int
        Readings of the difference that were used.
    heave : float or None
        Root mean square of zeta told from the phase; None where it was recorded or nothing of it shows.
    start : ProjectionFit
        The linear identity on the same record, roughly.
    residual : array
        Of the nonlinear identity, rad, laid out as that of `start`; NaN = missing, wild, or beyond the filters' reach.
    freedom : float
        Free parameters that heave told from the phase took.
    """

    frequency: float
    damping_rate: float
    sigma: float
    noise: float
    colour: float
    samples: int
    heave: float | None
    start: ProjectionFit
    residual: Floats
    freedom: float = 0.0


def invert(prepared: Prepared, *, look_for_heave: bool = True) -> Inverted:
    """Invert the nonlinear identity.

    Raises
    ------
    RefusedError
        Too few samples, or no swing at the nominal period.
    """
    held = linear_fit(prepared, bridged=True, rounds=1)
    iteration = begin(prepared, held)
    fit_damping = prepared.known_damping is None
    fit = fit_inversion(iteration, fit_damping=fit_damping)
    motion = iteration.motion
    residual = whole_residual(prepared, iteration, fit.limit)
    shown = replace(held, frequency=fit.frequency, noise=fit.noise, samples=fit.samples, residual=residual)
    colour = residual_colour(shown, prepared)
    swing = float(np.abs(iteration.start))
    dense = not at_marks(prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > HEAVE_COLOUR or (colour > 1.0 and fit.noise > HEAVE_EXCESS * prepared.noise_difference)
    shows = motion.vertical is None and coloured and fit.noise > HEAVE_FLOOR * swing
    if look_for_heave and dense and shows:
        from pipeline.inversion.heave import with_heave

        if not passes_zero(np.abs(prepared.blocks.difference)):  # heave is told from a phase
            return with_heave(prepared, iteration, fit, held, fit_damping)
    influence = iteration.least_squares_influence(fit.weights)
    return Inverted(
        frequency=fit.frequency,
        damping_rate=fit.damping_rate,
        sigma=float(
            np.sqrt(
                (fit.noise_gain * fit.noise) ** 2 * max(colour, 1.0)
                + theta_sigma(prepared, iteration, influence, fit.noise) ** 2
                + numerical_error(prepared, iteration) ** 2
                + (0.0 if dense else error_between_marks(prepared, iteration, fit, colour)) ** 2
                + (heave_left(prepared, fit, prepared.noise_difference) if dense and shows else 0.0) ** 2
            )
        ),
        noise=fit.noise,
        colour=colour,
        samples=fit.samples,
        heave=None,
        start=held,
        residual=residual,
    )


def begin(
    prepared: Prepared, held: ProjectionFit, theta: Floats | None = None, damping_difference: float | None = None
) -> Iteration:
    """The iteration before its first sweep; another first pendulum on the grid, or damping difference, may be given."""
    seen, grid = prepared.observation, make_grid(prepared)
    apart = seen.damping_difference if damping_difference is None else damping_difference
    if theta is not None:
        grid = replace(grid, theta=theta)
    motion = Motion(
        grid.theta,
        vertical_on(grid, prepared),
        grid.step,
        held.frequency,
        seen.frequency_ratio,
        held.damping_rate + apart,
        theta_noise(prepared),
        third_harmonic(prepared, grid),
    )
    return Iteration(grid, motion, held, seen.frequency_ratio, apart, prepared.gravity_of)


def third_harmonic(prepared: Prepared, grid: Grid) -> Floats | None:
    """`-(A^3/192) cos 3 phi` of the first pendulum's swing on the grid, rad; None where it is read as well as reckoned.

    A real pendulum's own; from the envelope of adjoining blocks.
    """
    envelope = prepared.blocks
    swing = fill(envelope.first)
    if theta_noise(prepared) < NOISY * float(np.median(np.abs(swing))):
        return None
    third = room(grid.theta.size)
    begin, cube = float(envelope.time[0]), swing**3 / -192.0
    for part in portions(third.size, third, unit=kernels.LEAST_TURNS):
        kernels.turning(cube, begin, envelope.hop, 3.0 * envelope.carrier, grid.step, third[part], part.start)
    return third


def numerical_error(prepared: Prepared, iteration: Iteration) -> float:
    """What filters, quadrature and interpolation may do to n2, rad s-1."""
    slope, time = iteration.slope, prepared.observation.time
    strength = float(np.sqrt(sum_of_squares(slope) / slope.size)) / (2.0 * iteration.frequency)
    step, law = iteration.motion.step if at_marks(prepared) else prepared.whole_step, COARSE
    if prepared.observation.step is None:
        step, law = float(time[-1]) / (time.size - 1), COARSE_UNEVEN
    return strength * (RIPPLE + law * (iteration.frequency * step) ** ORDER)


def error_between_marks(prepared: Prepared, iteration: Iteration, fit: InversionFit, colour: float) -> float:
    """What the motion between marks may hide, 1 sigma of n2, rad s-1."""
    frequency, stated = fit.frequency, prepared.observation.sigma_difference
    sway_share, heave_share = BETWEEN_MARKS
    sway = 0.25 * frequency * slow_variance(prepared)  # half of Browne's <psi^2>/2
    if iteration.motion.vertical is not None:
        zeta = iteration.motion.vertical / prepared.gravity_of(frequency)
        return float(np.hypot(sway_share * sway, heave_share * 0.125 * frequency * np.var(zeta)))
    # all of it may be heave where little of the residual lies at the swing itself
    white = 0.0 if colour < LEAST_COLOUR else fit.noise
    return float(np.hypot(sway_share * sway, heave_left(prepared, fit, white if stated is None else stated)))


def heave_left(prepared: Prepared, fit: InversionFit, noise: float) -> float:
    """What heave that nobody recorded may do where it is not told from the phase, 1 sigma of n2, rad s-1.

    It turns the phase to and fro: what the residual has above the reading noise (rad; NaN = none) may be it.
    """
    chance = 1.0 + 3.0 * float(np.sqrt(2.0 / fit.samples))
    excess = max(fit.noise**2 - float(np.nan_to_num(noise)) ** 2 * chance, 0.0)
    turned = 2.0 * excess / float(np.nanmean(np.abs(prepared.blocks.difference) ** 2))
    return 0.5 * HEAVE_RATE**2 / fit.frequency * turned


def make_grid(prepared: Prepared) -> Grid:
    """Uniform samples on the grid of the first pendulum, uneven readings beside a grid of their own."""
    seen = prepared.observation
    if seen.step is None:
        return Grid(
            prepared.whole, prepared.difference_on_grid, prepared.whole_step, Readings(seen.time, seen.difference)
        )
    theta, factor = first_pendulum(prepared)
    if factor == 1:
        return Grid(theta, prepared.clean_difference, seen.step)
    difference = room(theta.size)
    difference[:] = np.nan
    difference[::factor] = prepared.clean_difference
    return Grid(theta, difference, seen.step / factor)


def vertical_on(grid: Grid, prepared: Prepared) -> Floats | None:
    """z'' on the grid, m/s^2; None where the record has none."""
    seen = prepared.observation
    if seen.vertical is None:
        return None
    if seen.vertical.size == grid.theta.size:
        return seen.vertical
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(seen.time, seen.vertical)(np.arange(grid.theta.size) * grid.step))


def theta_noise(prepared: Prepared) -> float:
    """White reading noise of the first pendulum, rad: as neighbours tell it, or as stated, or nought."""
    if np.isfinite(prepared.noise_theta):
        return prepared.noise_theta
    return prepared.observation.sigma_theta or 0.0


def theta_sigma(prepared: Prepared, iteration: Iteration, influence: Floats, fallback: float) -> float:
    """1-sigma of n2 from the noise of the first pendulum and from its bridged gaps, rad s-1."""
    motion, gravity = iteration.motion, prepared.gravity_of(iteration.frequency)
    stiffness = room(influence.size)
    for part in portions(stiffness.size, stiffness, *motion.arrays):
        stiffness[part] = iteration.frequency**2 * motion.pull(gravity, part)
    through = theta_influence(
        influence,
        iteration.slope,
        motion.low,
        motion.curvature,
        iteration.about,
        stiffness,
        motion.step,
        iteration.eigenvalue,
        prepared.observation.frequency_ratio,
        iteration.frequency,
        prepared.observation.damping_difference,
        iteration.through,
        deaf=motion.third,
    )
    scale = float(np.sqrt(sum_of_squares(through)))
    # the grid may hold more points than were read: noise of the readings between them is shared
    scale *= float(np.sqrt(through.size / max(readings(prepared.observation.theta), 1)))
    return prepared.theta_error_of(scale, fallback)


def whole_residual(prepared: Prepared, iteration: Iteration, limit: float) -> Floats:
    """Residual at every sample of the record or of the finer grid, rad; NaN = missing, wild, or beyond the filters."""
    seen = prepared.observation
    residual = by_portions(lambda left: np.where(np.abs(left) > limit, np.nan, left), iteration.residual())
    if seen.step is None:
        count, within = seen.time.size, iteration.within
    else:
        count, within = iteration.motion.inside.stop + iteration.motion.inside.start, iteration.motion.inside
    whole = room(count)
    whole[: within.start] = whole[within.stop :] = np.nan
    for part in portions(residual.size, residual, whole):
        whole[part.start + within.start : part.stop + within.start] = residual[part]
    return whole
