"""Gauss-Newton on the exact nonlinear identity: one linear recursion with time-varying stiffness an iteration.

With theta1 recorded, the unknown horizontal acceleration drops out and the difference d obeys

    d'' + 2 gamma2 d' = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1' - n2^2 NL(d),
    NL(d) = (1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d),  w = (theta1'' + 2 gamma1 theta1')/n1^2

(the unknown eliminated between the two equations of motion). The linear response to theta1 at a held frequency comes
from the projection, by parts, without derivatives. The rest is expanded about an angle d*: at first the MEASURED
difference, later the model's; expanded about the measured one the start is good to 1e-3 even in heavy motion, where
iterating about a linear model diverges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.inversion import kernels
from pipeline.inversion.filters import design
from pipeline.projection.solve import REJECTION, ProjectionFit
from pipeline.projection.taps import NODES, continuation, stencil, taps
from pipeline.projection.uniform import UniformProblem, oscillation

ITERATIONS = 12
LEAST_SAMPLES_A_SWING = 7.5
_SETTLED = 1e-9  # of the frequency: what is left after such a step is a thousandth of it at most, 2e-6 mGal
_FLOOR = 1e-6  # of the amplitude: what departs less is rounding and quadrature, not a wild reading
_NEAR = 1e-3  # rad over half the record
_RIDGE = 1e-14


@dataclass(frozen=True)
class InversionFit:
    """Least squares for (start, n2, gamma2, offset) on the nonlinear identity.

    Attributes
    ----------
    frequency, damping_rate : float
        n2 at infinitesimal arc, rad s-1, and gamma2, s-1.
    noise : float
        1-sigma residual, rad.
    noise_gain : float
        1-sigma of n2 per radian of white noise in the difference, s-1.
    samples, rejected : int
        Readings used and left out as wild.
    weights : (5,) array
        Row of the covariance that belongs to n2, s-1.
    limit : float
        Departure from which readings count as wild, rad.
    """

    frequency: float
    damping_rate: float
    offset: float
    noise: float
    noise_gain: float
    samples: int
    rejected: int
    weights: Floats
    limit: float


class Motion:
    """What is known before the fit: the first pendulum, its acceleration, heave, on the grid less its ends.

    Parameters
    ----------
    theta : (n,) array
        First pendulum, rad, whole, `step` seconds apart.
    vertical : (n,) array or None
        z'', m/s^2, up positive.
    frequency, ratio, damping_rate : float
        n2 about which the filters are exact, n1/n2, gamma1.
    noise : float
        White reading noise of theta, rad (0 where not known).
    third : (n,) array, optional
        The third harmonic of theta's swing, rad, where it is known better than read: noise there comes back to the
        swing nine times as strong, and more of it than of any other.
    """

    def __init__(
        self,
        theta: Floats,
        vertical: Floats | None,
        step: float,
        frequency: float,
        ratio: float,
        damping_rate: float,
        noise: float,
        third: Floats | None = None,
    ) -> None:
        swing = 2.0 * np.pi / (frequency * step)
        if swing < LEAST_SAMPLES_A_SWING:
            raise RefusedError(
                f"time: {swing:.1f} readings a swing are too few for the nonlinear terms; give at least "
                f"{LEAST_SAMPLES_A_SWING:g}, or use projection"
            )
        filters = design(frequency * ratio, step, damping_rate, third is not None)
        count = theta.size - 2 * filters.reach
        self.step, self.inside = step, slice(filters.reach, filters.reach + count)
        self.heave: Floats | None = None  # zeta found by `heave.py`
        self.low, self.curvature = np.empty((2, count))
        kernels.filter_both(theta, filters.low, filters.curvature, self.low, self.curvature)
        self.third = third is not None
        if third is not None:
            self.curvature -= (3.0 * frequency * ratio) ** 2 * third[self.inside]
        self.curvature *= ratio**-2
        # mean of 1/cos and of theta1 w over the noise that the filters let pass
        self.shift = noise**2 * (0.5 * frequency**2 * filters.noise_low + filters.noise_product * ratio**-2)
        self.small = max(-self.low.min(), self.low.max()) < kernels.SMALL
        self.vertical = None if vertical is None else vertical[self.inside]
        self._still = np.ones(count)

    def pull(self, gravity: float) -> Floats:
        """1 + zeta."""
        if self.heave is not None:
            return 1.0 + self.heave
        return self._still if self.vertical is None else 1.0 + self.vertical / gravity


@dataclass(frozen=True)
class Grid:
    """Both series on one uniform grid, rad; theta whole, NaN = missing in the difference.

    Where the difference was read at uneven times, `difference` on the grid is only an angle to expand about, and
    `readings` are what is fitted.
    """

    theta: Floats
    difference: Floats
    step: float
    readings: Readings | None = None


@dataclass(frozen=True)
class Readings:
    """Readings at uneven times (s from the grid's start), rad, all finite."""

    time: Floats
    difference: Floats


def fit_inversion(iteration: Iteration, *, fit_damping: bool) -> InversionFit:
    """Fit the nonlinear identity; see `Iteration` for what it is given.

    Parameters
    ----------
    fit_damping : bool
        Whether gamma2 is fitted too.
    """
    free = [0, 1, 2, 3, 4] if fit_damping else [0, 1, 2, 4]
    limit = np.inf
    for _ in range(ITERATIONS):
        iteration.sweep()
        gram, rejected = iteration.moments(limit)
        found = solve(gram, free)
        iteration.improve(found.change)
        new_limit = max(REJECTION * found.noise, _FLOOR * abs(iteration.start))
        settled = abs(found.change[2]) < _SETTLED * iteration.frequency
        if settled and (new_limit > 0.98 * limit or iteration.wild(new_limit) == 0):
            break
        if abs(found.change[2]) * iteration.half < _NEAR:
            limit = new_limit
    return InversionFit(
        frequency=iteration.frequency,
        damping_rate=iteration.damping_rate,
        offset=iteration.offset,
        noise=found.noise,
        noise_gain=float(np.sqrt(found.covariance[2, 2])),
        samples=int(gram[4, 4]),
        rejected=rejected,
        weights=found.covariance[2],
        limit=limit,
    )


class Iteration:
    """What changes from iteration to iteration.

    Parameters
    ----------
    held : ProjectionFit
        The linear fit: its frequency is held in the linear part, its solution starts the iteration.
    ratio, damping_difference : float
        n1/n2, gamma1 - gamma2.
    gravity : callable
        m/s^2 of a trial n2.
    """

    def __init__(
        self,
        grid: Grid,
        motion: Motion,
        held: ProjectionFit,
        ratio: float,
        damping_difference: float,
        gravity: Callable[[float], float],
    ) -> None:
        self.motion, self._held, self._gravity = motion, held.frequency, gravity
        self._linear = UniformProblem(grid.theta, grid.difference, grid.step, held.frequency, ratio, damping_difference)
        self._cardinal = stencil(held.frequency, grid.step)
        self.frequency, self.damping_rate, self.offset = held.frequency, held.damping_rate, float(held.coefficient[2])
        self.difference = grid.difference[motion.inside]
        count = self.difference.size
        self.half = 0.5 * (count - 1) * grid.step
        # one piece of memory: the C library keeps what it was once given back in a large piece, and clears it no more
        work = np.empty(12 * count + 6)
        self.columns = work[: 4 * count].reshape(4, count)
        self._integral = work[4 * count : 6 * count].reshape(2, count)[:, : count - 1]
        self._terms = (work[8 * count + 3 : 9 * count + 3], work[6 * count : 7 * count], work[7 * count : 8 * count])
        self._wide = work[8 * count : 9 * count + 6]  # the constant part, continued by three samples at each end
        self.about, self.influence, self.through = work[9 * count + 6 :].reshape(3, count)
        self._gram = np.empty((kernels.COLUMNS, kernels.COLUMNS))
        self._hold_damping()
        begin = motion.inside.start * grid.step
        self.start = complex(held.coefficient[1], held.coefficient[0]) * np.exp(self.eigenvalue * begin)
        np.subtract(self.difference, self.offset, out=self.about)
        missing = np.isnan(self.about)
        if missing.any():
            age = np.flatnonzero(missing) * grid.step
            self.about[missing] = self._response[missing] + (self.start * np.exp(self.eigenvalue * age)).imag
        # a later model departs from the readings by little
        self._small = motion.small and max(-self.about.min(), self.about.max()) < 0.9 * kernels.SMALL
        self._readings: Readings | None = None
        if grid.readings is not None:
            self._place(grid.readings, begin)
        self._expand()
        # n2 with which the nonlinear pull does the work that the held frequency did
        pull = float(self._terms[0] @ self.about) / float(self.about @ self.about)
        self.frequency = float(self._held / np.sqrt(1.0 - pull / self._held**2))

    def _place(self, readings: Readings, begin: float) -> None:
        from pipeline.projection.uneven import from_grid

        time = readings.time - begin
        self.within = (time >= 0.0) & (time <= 2.0 * self.half)
        time = time[self.within]
        self._readings = Readings(time, readings.difference[self.within])
        self._where, self._weights = from_grid(time, self.motion.step, self.about.size, self._held)

    def _hold_damping(self) -> None:
        """Response of the linear part at the present damping."""
        self._linear.respond(self._held, self.damping_rate)
        self._response = self._linear.response[self.motion.inside]
        self.eigenvalue = complex(-self.damping_rate, oscillation(self._held, self.damping_rate))
        weights = taps(self._cardinal, self.eigenvalue, self.motion.step)
        self._taps = weights.real.copy(), weights.imag.copy()
        self._past = past_taps(self.eigenvalue, self.motion.step)

    def _expand(self) -> None:
        motion = self.motion
        (kernels.expand_small if self._small else kernels.expand_large)(
            self.about,
            motion.low,
            motion.curvature,
            motion.pull(self._gravity(self.frequency)),
            self._held,
            self.frequency,
            motion.shift,
            *self._terms,
        )

    @property
    def slope(self) -> Floats:
        """Stiffness that changes with time, s-2: what the recursion adds to the held one."""
        return np.asarray(self._terms[1])

    def sweep(self) -> None:
        """Expand, and run the recursion."""
        self._expand()
        constant, slope, by_frequency = self._terms
        eigenvalue = self.eigenvalue
        real, imaginary = self._integral
        onward = continuation(self._held, self.motion.step)
        self._wide[2::-1], self._wide[-3:] = constant[NODES - 1 :: -1] @ onward, constant[-NODES:] @ onward
        kernels.interval_integrals(self._wide, *self._taps, real, imaginary)
        kernels.recursion(
            real,
            imaginary,
            slope,
            self.about,
            self._response,
            by_frequency,
            complex(np.exp(eigenvalue * self.motion.step)),
            eigenvalue.imag,
            self._past,
            self.start,
            self.columns,
        )

    def moments(self, limit: float) -> tuple[Floats, int]:
        """Gram matrix of (start angle, start rate, n2, gamma2, offset, residual) and the number of wild readings."""
        if self._readings is not None:
            return self._uneven_moments(self._readings, limit)
        beyond = kernels.moments(self.difference, self.columns, self.offset, limit, self._gram)
        return self._gram, beyond

    def _uneven_moments(self, readings: Readings, limit: float) -> tuple[Floats, int]:
        model, angle, rate, frequency = self.at_readings(self.columns)
        residual = readings.difference - model - self.offset
        damping = (1.0 - readings.time / self.half) * model
        columns = np.stack([angle, rate, frequency, damping, np.ones(model.size), residual])
        used = np.abs(residual) <= limit
        chosen = columns if used.all() else columns[:, used]
        return chosen @ chosen.T, int((~used).sum())

    def at_readings(self, series: Floats) -> Floats:
        """Series on the grid, (..., n), taken to the uneven times."""
        around = series[..., self._where[:, None] + np.arange(NODES)]
        return np.asarray(np.einsum("...ij,ij->...i", around, self._weights))

    def improve(self, change: Floats) -> None:
        """Follow the tangents to the improved parameters."""
        angle, rate, frequency, damping, offset = change
        kernels.follow(self.columns, angle, rate, frequency, damping, self.about)
        self.start += complex(rate, angle)
        self.frequency += frequency
        self.offset += offset
        if damping != 0.0:
            self.damping_rate += damping / self.half
            # the solution decays about the middle of the record, the start lies half a record earlier
            self.start *= 1.0 + damping
            self._hold_damping()
        if not np.isfinite(self.frequency) or abs(self.damping_rate) > 0.1 * self._held:
            raise RefusedError("difference: no swing near the nominal period; check instrument/period and the traces")

    def adopt(self, other: Iteration) -> None:
        """Take over the parameters, and the angle to expand about, of an iteration on the same grid."""
        self.damping_rate = other.damping_rate
        self._hold_damping()
        self.start, self.frequency, self.offset = other.start, other.frequency, other.offset
        self.about[:] = other.about

    def residual(self) -> Floats:
        """Readings less the model, rad, NaN = missing."""
        if self._readings is None:
            return np.asarray(self.difference - self.about - self.offset)
        return np.asarray(self._readings.difference - self.at_readings(self.about) - self.offset)

    def on_grid(self) -> Floats:
        """Residual on the grid, NaN = missing; of uneven readings, that of the angle that was expanded about."""
        if self._readings is None:
            return self.residual()
        return np.asarray(self.difference - self.about - self.offset)

    def wild(self, limit: float) -> int:
        """Readings farther than the limit from the model."""
        return int(np.count_nonzero(np.abs(self.residual()) > limit))


def past_taps(eigenvalue: complex, step: float) -> Floats:
    """Weights of `int_0^h exp(lam (h - x)) f(x) dx` from f(0) and f(-h), exact for cos and sin at Im(lam); (2, 2)."""
    gamma, oscillation = -eigenvalue.real, eigenvalue.imag
    turn = np.exp(1j * oscillation * step)
    # of f = exp(+-i w x); the first without the small difference of large numbers
    ahead = turn * (step if gamma == 0.0 else -np.expm1(-gamma * step) / gamma)
    behind = (np.conj(turn) - np.exp(eigenvalue * step)) / (gamma - 2j * oscillation)
    now, before = np.linalg.solve(np.array([[1.0, np.conj(turn)], [1.0, turn]]), np.array([ahead, behind]))
    return np.array([[now.real, before.real], [now.imag, before.imag]])


@dataclass(frozen=True)
class Solution:
    """Change of the five parameters, 1-sigma residual (rad), covariance per variance of noise."""

    change: Floats
    noise: float
    covariance: Floats


def solve(gram: Floats, free: list[int]) -> Solution:
    """Least squares that the moments stand for, in scaled columns; parameters not free do not change."""
    if not np.all(np.isfinite(gram)) or gram[4, 4] < 2 * len(free):
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    chosen = gram[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.diag(chosen))
    inverse = np.linalg.inv(chosen * scale[:, None] * scale + _RIDGE * np.eye(len(free)))
    inverse *= scale[:, None] * scale
    right = gram[free, 5]
    solved = inverse @ right
    change, covariance = np.zeros(5), np.zeros((5, 5))
    change[free], covariance[np.ix_(free, free)] = solved, inverse
    squares = max(float(gram[5, 5] - right @ solved), 0.0)
    return Solution(change, float(np.sqrt(squares / max(gram[4, 4] - len(free), 1.0))), covariance)
