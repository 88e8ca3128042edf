"""From a prepared record to its nonlinear inversion: the grid, the linear start, heave where it shows, the error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.inversion.influence import theta_influence
from pipeline.inversion.solve import Grid, InversionFit, Iteration, Motion, Readings, fit_inversion
from pipeline.methods.projection import residual_colour
from pipeline.prepared import Prepared
from pipeline.projection.sampling import FINE_ANGLE, MOST_ANGLE, problem
from pipeline.projection.solve import ProjectionFit, fit_projection

HEAVE_COLOUR = 3.0  # power of the residual near the swing over white from which heave is looked for
HEAVE_FLOOR = 1e-5  # of the amplitude: a smaller residual shows no heave


@dataclass(frozen=True)
class Inverted:
    """What the nonlinear inversion found.

    Attributes
    ----------
    frequency, damping_rate : float
        n2 at infinitesimal arc, rad s-1; gamma2, s-1.
    sigma : float
        1-sigma of n2 from the noise of both traces, rad s-1.
    noise, colour : float
        1-sigma residual, rad; its power near the swing over that of white noise.
    samples : int
        Readings of the difference that were used.
    heave : float or None
        Root mean square of zeta told from the phase; None where it was recorded or nothing of it shows.
    """

    frequency: float
    damping_rate: float
    sigma: float
    noise: float
    colour: float
    samples: int
    heave: float | None


def invert(prepared: Prepared) -> Inverted:
    """Invert the nonlinear identity.

    Raises
    ------
    RefusedError
        Too few samples a swing or in all, or no swing at the nominal period.
    """
    seen, rough = prepared.observation, prepared.rough
    fit_damping = prepared.known_damping is None
    held = fit_projection(problem(prepared), rough.frequency, rough.damping_rate, fit_damping)
    grid = make_grid(prepared)
    motion = Motion(
        grid.theta,
        vertical_on(grid, prepared),
        grid.step,
        held.frequency,
        seen.frequency_ratio,
        held.damping_rate + seen.damping_difference,
        theta_noise(prepared),
    )
    iteration = Iteration(grid, motion, held, seen.frequency_ratio, seen.damping_difference, prepared.gravity_of)
    fit = fit_inversion(iteration, fit_damping=fit_damping)
    colour = _colour(prepared, held, iteration, fit)
    swing = float(np.abs(iteration.start))
    dense = seen.step is None or seen.step * prepared.nominal <= MOST_ANGLE
    if motion.vertical is None and dense and colour > HEAVE_COLOUR and fit.noise > HEAVE_FLOOR * swing:
        from pipeline.inversion.heave import with_heave

        return with_heave(prepared, iteration, fit, fit_damping)
    influence = least_squares_influence(iteration, fit)
    return Inverted(
        frequency=fit.frequency,
        damping_rate=fit.damping_rate,
        sigma=float(
            np.hypot(
                fit.noise_gain * fit.noise * np.sqrt(max(colour, 1.0)),
                theta_sigma(prepared, iteration, influence, fit.noise),
            )
        ),
        noise=fit.noise,
        colour=colour,
        samples=fit.samples,
        heave=None,
    )


def make_grid(prepared: Prepared) -> Grid:
    """Uniform samples as they are, marks on a finer grid, uneven readings beside a grid of their own."""
    seen = prepared.observation
    if seen.step is None:
        from pipeline.uneven_grid import to_grid

        present = np.isfinite(seen.difference)
        about = to_grid(seen.time, seen.difference, prepared.whole_step, prepared.nominal)
        return Grid(prepared.whole, about, prepared.whole_step, Readings(seen.time[present], seen.difference[present]))
    if seen.step * prepared.nominal <= MOST_ANGLE:
        return Grid(prepared.whole, prepared.clean_difference, seen.step)
    factor = int(np.ceil(seen.step * prepared.nominal / FINE_ANGLE))
    theta = prepared.finer(seen.step, factor)
    difference = np.full(theta.size, np.nan)
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


def least_squares_influence(iteration: Iteration, fit: InversionFit) -> Floats:
    """d n2 / d (reading of the difference) on the grid, s-1; zero where there is none."""
    angle, rate, frequency = iteration.columns[1:]
    age = np.linspace(-1.0, 1.0, angle.size)
    start_angle, start_rate, own, damping, offset = fit.weights
    influence = start_angle * angle + start_rate * rate + own * frequency - damping * age * iteration.about + offset
    influence[np.isnan(iteration.difference)] = 0.0
    return np.asarray(influence)


def theta_sigma(prepared: Prepared, iteration: Iteration, influence: Floats, fallback: float) -> float:
    """1-sigma of n2 from the noise of the first pendulum and from its bridged gaps, rad s-1."""
    motion = iteration.motion
    through = theta_influence(
        influence,
        iteration.slope,
        motion.low,
        motion.curvature,
        iteration.about,
        iteration.frequency**2 * motion.pull(prepared.gravity_of(iteration.frequency)),
        motion.step,
        iteration.eigenvalue,
        prepared.observation.frequency_ratio,
        iteration.frequency,
    )
    scale = float(np.sqrt(np.sum(through**2)))
    # the grid may hold more points than were read: noise of the readings between them is shared
    scale *= np.sqrt(through.size / max(np.isfinite(prepared.observation.theta).sum(), 1))
    return prepared.theta_error(replace(prepared.rough_budget, noise_theta=scale), fallback)


def _colour(prepared: Prepared, held: ProjectionFit, iteration: Iteration, fit: InversionFit) -> float:
    seen = prepared.observation
    residual = iteration.residual()
    residual[np.abs(residual) > fit.limit] = np.nan
    if seen.step is None:
        whole = np.full(seen.time.size, np.nan)
        whole[np.flatnonzero(np.isfinite(seen.difference))[iteration.within]] = residual
    else:
        inside = iteration.motion.inside
        whole = np.full(inside.stop + inside.start, np.nan)
        whole[inside] = residual
    return residual_colour(
        replace(held, frequency=fit.frequency, noise=fit.noise, samples=fit.samples, residual=whole), prepared
    )
