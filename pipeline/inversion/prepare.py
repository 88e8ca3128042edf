"""From a prepared record to its nonlinear inversion: the grid, the linear start, the error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import portions, room
from pipeline.arrays import Floats, sum_of_squares
from pipeline.harmonics.envelope import fill
from pipeline.inversion import kernels
from pipeline.inversion.influence import theta_influence
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.motion import Motion
from pipeline.inversion.solve import fit_inversion
from pipeline.methods.projection import linear_fit, residual_colour
from pipeline.prepared import Prepared
from pipeline.projection.solve import ProjectionFit

NOISY = 3e-4  # reading noise of the first pendulum over its swing, from which its third harmonic is better reckoned
COLOURED = 3.0  # power of the residual near the swing over white, from which the identity does not fit
EXCESS = 2.0  # residual over the reading noise, the same
FLOOR = 1e-5  # of the amplitude: a smaller residual shows nothing
RIPPLE, COARSE, ORDER = 3e-9, 5e-6, 8
"""Numerical error, in parts of the strength of the nonlinear terms: the filters' ripple, and the quadrature's, which
grows with that power of the swing's turn between readings; measured on simulated records (five motions, six rates)."""


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
    """

    frequency: float
    damping_rate: float
    sigma: float
    noise: float
    colour: float
    samples: int


def invert(prepared: Prepared) -> Inverted:
    """Invert the nonlinear identity.

    Raises
    ------
    RefusedError
        No swing at the nominal period, wild readings, or a heave that is not recorded.
    """
    iteration = begin(prepared, linear_fit(prepared, rounds=1))
    fit = fit_inversion(iteration, fit_damping=prepared.known_damping is None)
    colour = residual_colour(iteration.residual(), fit.frequency, fit.noise, prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > COLOURED or (colour > 1.0 and fit.noise > EXCESS * prepared.noise_difference)
    if iteration.motion.vertical is None and coloured and fit.noise > FLOOR * float(np.abs(iteration.start)):
        raise RefusedError(
            "record/vertical_acceleration: not recorded, and the residual is not that of real pendulums on a support "
            "that does not heave; use --method joint"
        )
    influence = iteration.least_squares_influence(fit.weights)
    return Inverted(
        frequency=fit.frequency,
        damping_rate=fit.damping_rate,
        sigma=float(
            np.sqrt(
                (fit.noise_gain * fit.noise) ** 2 * max(colour, 1.0)
                + theta_sigma(prepared, iteration, influence, fit.noise) ** 2
                + numerical_error(prepared, iteration) ** 2
            )
        ),
        noise=fit.noise,
        colour=colour,
        samples=fit.samples,
    )


def begin(prepared: Prepared, held: ProjectionFit) -> Iteration:
    """The iteration before its first sweep."""
    seen = prepared.observation
    motion = Motion(
        seen.theta,
        seen.vertical,
        seen.step,
        held.frequency,
        seen.frequency_ratio,
        held.damping_rate + seen.damping_difference,
        theta_noise(prepared),
        third_harmonic(prepared),
    )
    return Iteration(seen, motion, held, prepared.gravity_of)


def third_harmonic(prepared: Prepared) -> Floats | None:
    """`-(A^3/192) cos 3 phi` of the first pendulum's swing, rad; None where it is read as well as reckoned.

    A real pendulum's own; from the envelope of adjoining blocks.
    """
    envelope = prepared.blocks
    swing = fill(envelope.first)
    if theta_noise(prepared) < NOISY * float(np.median(np.abs(swing))):
        return None
    seen = prepared.observation
    third = room(seen.theta.size)
    begin, cube = float(envelope.time[0]), swing**3 / -192.0
    for part in portions(third.size, third, unit=kernels.LEAST_TURNS):
        kernels.turning(cube, begin, envelope.hop, 3.0 * envelope.carrier, seen.step, third[part], part.start)
    return third


def numerical_error(prepared: Prepared, iteration: Iteration) -> float:
    """What filters, quadrature and interpolation may do to n2, rad s-1."""
    slope = iteration.slope
    strength = float(np.sqrt(sum_of_squares(slope) / slope.size)) / (2.0 * iteration.frequency)
    return strength * (RIPPLE + COARSE * (iteration.frequency * iteration.motion.step) ** ORDER)


def theta_noise(prepared: Prepared) -> float:
    """White reading noise of the first pendulum, rad: as neighbours tell it, or as stated, or nought."""
    if np.isfinite(prepared.noise_theta):
        return prepared.noise_theta
    return prepared.observation.sigma_theta or 0.0


def theta_sigma(prepared: Prepared, iteration: Iteration, influence: Floats, fallback: float) -> float:
    """1-sigma of n2 from the noise of the first pendulum, rad s-1."""
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
    return prepared.theta_error(float(np.sqrt(sum_of_squares(through))), fallback)
