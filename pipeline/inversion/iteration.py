"""Gauss-Newton on the exact nonlinear identity: one linear recursion with time-varying stiffness a round.

With theta1 recorded, the unknown horizontal acceleration drops out and the difference d obeys

    d'' + 2 gamma2 d' = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1' - n2^2 NL(d),
    NL(d) = (1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d),  w = (theta1'' + 2 gamma1 theta1')/n1^2

(the unknown eliminated between the two equations of motion, formula sheet 1.1). The linear response to theta1 at a held
frequency is the projection's, by parts, without derivatives. The rest is expanded about an angle d*: at first the
MEASURED difference, later the model's; expanded about the measured one the start is good to 1e-3 even in heavy motion,
where iterating about a linear model diverges.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.arrays import Floats
from pipeline.inversion.kernels import adjoint, expand, past_taps, recursion
from pipeline.inversion.motion import Motion
from pipeline.observation import Observation
from pipeline.projection.identity import (
    Constants,
    LinearFit,
    Step,
    free_parameters,
    refuse_outliers,
    require_swing_near,
    response_constants,
    solve,
)
from pipeline.projection.taps import AFTER, BEFORE, padded, stencil, taps

ITERATIONS = 12
_SETTLED = 1e-9  # of the frequency: what is left after such a step is a thousandth of it at most, 2e-6 mGal


class Iteration:
    """What changes from round to round.

    Parameters
    ----------
    seen : Observation
    motion : Motion
    held : LinearFit
        The linear fit: its frequency is held in the linear part, its solution starts the iteration.
    gravity : callable
        m s-2 of a trial n2.

    Attributes
    ----------
    frequency, damping_rate, offset : float
        n2 at infinitesimal arc, gamma2, zero line of the difference.
    about, slope : (m,) arrays
        d*, rad, at last the model; stiffness that changes with time, s-2.
    columns : (4, m) array
        Model and its derivatives by start (angle, rate over w) and n2, at the last sweep.
    """

    def __init__(self, seen: Observation, motion: Motion, held: LinearFit, gravity: Callable[[float], float]) -> None:
        self.motion, self.step, self._gravity = motion, seen.step, gravity
        self._held, self._apart = held.frequency, (seen.frequency_ratio, seen.damping_difference)
        inside = motion.inside
        self._theta, self.difference = seen.theta[inside.start - BEFORE : inside.stop + AFTER], seen.difference[inside]
        self.frequency, self.damping_rate, self.offset = held.frequency, held.damping_rate, held.offset
        self.count = self.difference.size
        self.columns: Floats = np.empty((4, self.count))
        self.slope: Floats = np.empty(self.count)
        self.start = 1j * held.start * complex(np.exp(self.eigenvalue * self.step * inside.start))
        self.about: Floats = self.difference - self.offset
        # n2 with which the nonlinear pull does the work that the held frequency did
        work = float(self._expand() @ self.about) / float(self.about @ self.about)
        self.frequency = float(self._held / np.sqrt(1.0 - work / self._held**2))

    def _linear(self) -> Constants:
        return response_constants(self._held, self.damping_rate, *self._apart)

    @property
    def eigenvalue(self) -> complex:
        """lam of the linear part, s-1."""
        return self._linear()[0]

    def _expand(self) -> Floats:
        """Expand the nonlinear terms about d*: constant part; slope, and derivative by n2 where that of d will be."""
        motion, constant = self.motion, np.empty(self.count)
        expand(
            self.about,
            motion.low,
            motion.bend,
            motion.pull(self._gravity(self.frequency)),
            self._held,
            self.frequency,
            motion.shift,
            constant,
            self.slope,
            self.columns[3],
        )
        return constant

    def sweep(self) -> Floats:
        """Expand, and run the recursion; the Gram matrix of `identity.solve`."""
        eigenvalue, direct, gain, *_ = self._linear()
        rate, held, step = eigenvalue.imag, self._held, self.step
        constants = (direct.real, rate * gain, complex(np.exp(eigenvalue * step)), rate)
        weights, past = taps(stencil(held, step), eigenvalue, step), past_taps(eigenvalue, step)
        gram = np.zeros((6, 6))
        recursion(
            self._theta,
            padded(self._expand(), held, step),
            self.slope,
            self.about,
            self.difference - self.offset,
            weights,
            constants,
            past,
            self.start,
            self.columns,
            gram,
        )
        return gram

    def scaled_time(self) -> Floats:
        """-1 to 1 over the record: damping counts from its middle, per half its length."""
        return np.linspace(-1.0, 1.0, self.count)

    def improve(self, change: Floats) -> None:
        """Follow the derivatives to the improved parameters."""
        angle, rate, frequency, damping, offset = change
        self.about = self.columns[0] + change[:3] @ self.columns[1:]
        if damping != 0.0:
            self.about -= damping * self.scaled_time() * self.columns[0]
        self.frequency, self.offset = self.frequency + float(frequency), self.offset + float(offset)
        # the solution decays about the middle of the record, the start lies half a record earlier
        self.start = (self.start + complex(rate, angle)) * (1.0 + damping)
        self.damping_rate += float(damping) / (0.5 * (self.count - 1) * self.step)
        require_swing_near(self.frequency, self.damping_rate)

    def fit(self, *, fit_damping: bool) -> Step:
        """Iterate until n2 stands still; the last step is returned.

        Raises
        ------
        RefusedError
            No swing at the nominal period, or an outlier.
        """
        for _ in range(ITERATIONS):
            found = solve(self.sweep(), free_parameters(fit_damping))
            self.improve(found.change)
            if abs(found.change[2]) < _SETTLED * self.frequency:
                break
        refuse_outliers(self.residual(), found.noise, abs(self.start))
        return found

    def influence(self, weights: Floats) -> Floats:
        """d n2 / d (sample of the difference), s-1, from the covariance's row of n2."""
        out: Floats = weights[:3] @ self.columns[1:] + weights[4]
        if weights[3] != 0.0:
            out -= weights[3] * self.scaled_time() * self.about
        return out

    def residual(self) -> Floats:
        """Samples less the model, rad."""
        return np.asarray(self.difference - self.about - self.offset)


def theta_influence(
    iteration: Iteration, influence: Floats, pull: float, ratio: float, damping_difference: float
) -> Floats:
    """d n2 / d theta1 at every sample, s-1.

    Parameters
    ----------
    iteration : Iteration
        Settled.
    influence : (m,) array
        d n2 / d (sample of the difference), s-1.
    pull : float
        Gravity of the fitted n2, m s-2.
    ratio, damping_difference : float
        n1/n2; gamma1 - gamma2, s-1.
    """
    motion, step, frequency, eigenvalue = iteration.motion, iteration.step, iteration.frequency, iteration.eigenvalue
    back = np.empty(influence.size)
    adjoint(influence, iteration.slope, complex(np.exp(eigenvalue * step)), eigenvalue.imag, step, back)
    r, angle = ratio**-2, frequency * step
    # back swings at n2: its second derivative is -n2^2 of it, and its first is a difference of its neighbours
    drag = 2.0 * (-eigenvalue.real * (1.0 - r) - r * damping_difference)
    straight, turned = step * (1.0 - r) * frequency**2, 0.5 * drag * angle / np.sin(angle)
    bent_taps = second_difference(angle, r / step, motion.third)
    sine, tangent, cosine = np.sin(iteration.about), np.tan(motion.low), np.cos(motion.low)
    bent = (tangent * sine - 2.0 * np.sin(0.5 * iteration.about) ** 2) * back
    out = np.correlate(bent, bent_taps, "same") + turned * np.correlate(back, [-1.0, 0.0, 1.0], "same")
    lever = (frequency**2 * motion.pull(pull) * tangent + motion.bend / cosine) / cosine * sine
    return np.asarray(out + (straight + step * lever) * back)


def second_difference(turn: float, scale: float, notch: bool = False) -> Floats:
    """Seven symmetric taps of `scale d^2`, right at zero and at one, two and three times `turn` rad.

    notch: at three times it is zero.
    """
    rates = turn * np.arange(4.0)
    matrix = np.stack([np.ones(4), *(2.0 * np.cos(rates * k) for k in (1, 2, 3))], axis=-1)
    wanted = -scale * rates**2
    if notch:
        wanted[3] = 0.0
    half = np.linalg.solve(matrix, wanted)
    return np.concatenate([half[:0:-1], half])
