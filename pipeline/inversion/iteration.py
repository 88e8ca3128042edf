"""Gauss-Newton on the exact nonlinear identity: one linear recursion with time-varying stiffness a round.

With theta1 recorded, the unknown horizontal acceleration drops out and the difference d obeys

    d'' + 2 gamma2 d' = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1' - n2^2 NL(d),
    NL(d) = (1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d),  w = (theta1'' + 2 gamma1 theta1')/n1^2

(the unknown eliminated between the two equations of motion, formula sheet 1.1). The linear response to theta1 at a held
frequency is the projection's, by parts, without derivatives. The rest is expanded about an angle d*: at first the
MEASURED difference, later the model's; expanded about the measured one the start is good to 1e-3 even in heavy motion,
where iterating about a linear model diverges.

What is kept of a long record lies in scratch files and is gone through in portions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from data_schemas.scratch import by_portions, portions, release, room
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
from pipeline.projection.taps import padded, stencil, taps

ITERATIONS = 12
_SETTLED = 1e-9  # of the frequency: what is left after such a step is a thousandth of it at most, 2e-6 mGal
BESIDE = 3  # samples on both sides that the taps of a second difference reach


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
        self._theta, self.difference = seen.theta, seen.difference[motion.inside]
        self.frequency, self.damping_rate, self.offset = held.frequency, held.damping_rate, held.offset
        self.count = self.difference.size
        self.columns: Floats = room(4 * self.count).reshape(4, self.count)
        self.about, self.slope, self._constant = (room(self.count) for _ in range(3))
        self.start = 1j * held.start * complex(np.exp(self.eigenvalue * self.step * motion.inside.start))
        for part in self._portions():
            self.about[part] = self.difference[part] - self.offset
        # n2 with which the nonlinear pull does the work that the held frequency did
        self._expand()
        work = square = 0.0
        for part in self._portions():
            about = self.about[part]
            work, square = work + float(self._constant[part] @ about), square + float(about @ about)
        self.frequency = float(self._held / np.sqrt(1.0 - work / square / self._held**2))

    def _portions(self) -> Iterator[slice]:
        arrays = (self.columns, self.about, self.slope, self._constant, self.difference, self._theta)
        return portions(self.count, *arrays, *self.motion.arrays)

    def _linear(self) -> Constants:
        return response_constants(self._held, self.damping_rate, *self._apart)

    @property
    def eigenvalue(self) -> complex:
        """lam of the linear part, s-1."""
        return self._linear()[0]

    def _expand(self) -> None:
        """Expand the nonlinear terms about d*: constant part, slope, and derivative by n2 (where that of d will be)."""
        motion, pull = self.motion, self._gravity(self.frequency)
        for part in self._portions():
            expand(
                self.about[part],
                motion.low[part],
                motion.bend[part],
                motion.pull(pull, part),
                self._held,
                self.frequency,
                motion.shift,
                self._constant[part],
                self.slope[part],
                self.columns[3, part],
            )

    def sweep(self) -> Floats:
        """Expand, and run the recursion; the Gram matrix of `identity.solve`."""
        self._expand()
        eigenvalue, direct, gain, *_ = self._linear()
        rate, held, step = eigenvalue.imag, self._held, self.step
        constants = (direct.real, rate * gain, complex(np.exp(eigenvalue * step)), rate)
        weights, past = taps(stencil(held, step), eigenvalue, step), past_taps(eigenvalue, step)
        state, before = np.array([self.start, 1j, 1.0, 0.0], dtype=np.complex128) * rate, np.zeros(4)
        gram, lost = np.zeros((6, 6)), self.motion.inside.start
        for part in self._portions():
            recursion(
                padded(self._theta, slice(part.start + lost, part.stop + lost), held, step),
                padded(self._constant, part, held, step),
                self.slope[part],
                self.about[part],
                self.difference[part] - self.offset,
                weights,
                constants,
                past,
                part.start,
                self.count,
                state,
                before,
                self.columns[:, part],
                gram,
            )
        return gram

    def scaled_time(self, part: slice) -> Floats:
        """-1 to 1 over the record: damping counts from its middle, per half its length."""
        return np.asarray(np.arange(part.start, part.stop) * (2.0 / (self.count - 1)) - 1.0)

    def improve(self, change: Floats) -> None:
        """Follow the derivatives to the improved parameters."""
        angle, rate, frequency, damping, offset = change
        for part in self._portions():
            self.about[part] = self.columns[0, part] + change[:3] @ self.columns[1:, part]
            if damping != 0.0:
                self.about[part] -= damping * self.scaled_time(part) * self.columns[0, part]
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
        out = room(self.count)
        for part in self._portions():
            out[part] = weights[:3] @ self.columns[1:, part] + weights[4]
            if weights[3] != 0.0:
                out[part] -= weights[3] * self.scaled_time(part) * self.about[part]
        return out

    def residual(self) -> Floats:
        """Samples less the model, rad."""
        return by_portions(lambda read, model: read - model - self.offset, self.difference, self.about)


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
    count = influence.size
    back, out = room(count), room(count)
    turn, state = complex(np.exp(eigenvalue * step)), 0.0j
    for part in reversed(list(portions(count))):
        state = adjoint(influence[part], iteration.slope[part], turn, eigenvalue.imag, step, state, back[part])
        release(influence, iteration.slope, back)
    r, angle = ratio**-2, frequency * step
    # back swings at n2: its second derivative is -n2^2 of it, and its first is a difference of its neighbours
    drag = 2.0 * (-eigenvalue.real * (1.0 - r) - r * damping_difference)
    straight, turned = step * (1.0 - r) * frequency**2, 0.5 * drag * angle / np.sin(angle)
    bent_taps = second_difference(angle, r / step, motion.third)
    for part in portions(count, back, iteration.about, out, *motion.arrays):
        near = slice(max(part.start - BESIDE, 0), min(part.stop + BESIDE, count))
        left, right = BESIDE - (part.start - near.start), BESIDE - (near.stop - part.stop)
        b, d, t = back[near], iteration.about[near], motion.low[near]
        secant, sine = 1.0 / np.cos(t), np.sin(d)
        tangent = np.sin(t) * secant
        lever = (frequency**2 * motion.pull(pull, near) * tangent + motion.bend[near] * secant) * secant * sine
        bent = np.pad((tangent * sine - 2.0 * np.sin(0.5 * d) ** 2) * b, (left, right))
        wide = np.pad((straight + step * lever) * b, (left, right))
        out[part] = wide[BESIDE:-BESIDE] + np.correlate(bent, bent_taps, "valid")
        b = np.pad(b, (left, right))
        out[part] += turned * (b[BESIDE + 1 : 1 - BESIDE] - b[BESIDE - 1 : -BESIDE - 1])
    return out


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
