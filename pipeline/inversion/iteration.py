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

from data_schemas.scratch import by_portions, portions, room
from pipeline.arrays import Floats
from pipeline.inversion.kernels import past_taps, recursion
from pipeline.inversion.motion import Motion
from pipeline.observation import Observation
from pipeline.projection.identity import LinearFit, response_constants
from pipeline.projection.least_squares import Step, free_parameters, refuse_outliers, require_swing_near, solve
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

    def __init__(
        self, seen: Observation, motion: Motion, held: LinearFit, gravity: Callable[[float], float]
    ) -> None:
        self.motion, self.step, self._gravity = motion, seen.step, gravity
        self._held, self._ratio, self._damping_difference = held.frequency, seen.frequency_ratio, seen.damping_difference
        self._theta, self.difference = seen.theta, seen.difference[motion.inside]
        self.frequency, self.damping_rate, self.offset = held.frequency, held.damping_rate, held.offset
        self.count = self.difference.size
        self.columns: Floats = room(4 * self.count).reshape(4, self.count)
        self.about, self.slope, self._constant = (room(self.count) for _ in range(3))
        eigenvalue, _, gain, *_ = self._linear()
        self.start = held.start * complex(np.exp(eigenvalue * self.step * motion.inside.start)) * 1j
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

    def _linear(self) -> tuple[complex, ...]:
        return response_constants(self._held, self.damping_rate, self._ratio, self._damping_difference)

    @property
    def eigenvalue(self) -> complex:
        """lam of the linear part, s-1."""
        return self._linear()[0]

    def _expand(self) -> None:
        """Expand the nonlinear terms about d*: constant part, slope, and derivative by n2 (where that of d will be)."""
        motion, pull = self.motion, self._gravity(self.frequency)
        for part in self._portions():
            self._constant[part], self.slope[part], self.columns[3, part] = expand(
                self.about[part],
                motion.low[part],
                motion.bend[part],
                motion.pull(pull, part),
                self._held,
                self.frequency,
                motion.shift,
            )

    def sweep(self) -> None:
        """Expand, and run the recursion."""
        self._expand()
        eigenvalue, direct, gain, *_ = self._linear()
        rate, turn = eigenvalue.imag, complex(np.exp(eigenvalue * self.step))
        weights = taps(stencil(self._held, self.step), eigenvalue, self.step)
        past = past_taps(eigenvalue, self.step)
        state = np.array([self.start, 1j, 1.0, 0.0]) * rate
        before, lost = np.zeros(4), self.motion.inside.start
        for part in self._portions():
            theta = padded(self._theta, slice(part.start + lost, part.stop + lost), self._held, self.step)
            integral = rate * gain * _correlated(theta, weights)
            integral += _correlated(padded(self._constant, part, self._held, self.step), weights)
            response = direct.real * theta[BEFORE:-AFTER]
            columns = self.columns[:, part]
            recursion(integral, self.slope[part], self.about[part], response, turn, rate, past, state, before, columns)

    def gram(self) -> Floats:
        """Gram matrix (6, 6) of the derivatives by (start, start, n2, gamma2, offset) and the residual."""
        gram = np.zeros((6, 6))
        for part in self._portions():
            model, *derivatives = self.columns[:, part]
            by_damping = -self.scaled_time(part) * model
            residual = self.difference[part] - model - self.offset
            rows = np.stack([*derivatives, by_damping, np.ones(model.size), residual])
            gram += rows @ rows.T
        return gram

    def scaled_time(self, part: slice) -> Floats:
        """-1 to 1 over the record: damping counts from its middle, per half its length."""
        return np.asarray(np.arange(part.start, part.stop) * (2.0 / (self.count - 1)) - 1.0)

    def improve(self, change: Floats) -> None:
        """Follow the derivatives to the improved parameters."""
        angle, rate, frequency, damping, offset = change
        for part in self._portions():
            model, *derivatives = self.columns[:, part]
            moved = model * (1.0 - damping * self.scaled_time(part))
            self.about[part] = moved + np.tensordot(change[:3], np.stack(derivatives), axes=1)
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
            self.sweep()
            found = solve(self.gram(), free_parameters(fit_damping))
            self.improve(found.change)
            if abs(found.change[2]) < _SETTLED * self.frequency:
                break
        refuse_outliers(self.residual(), found.noise, abs(self.start))
        return found

    def influence(self, weights: Floats) -> Floats:
        """d n2 / d (sample of the difference), s-1, from the covariance's row of n2."""
        out = room(self.count)
        for part in self._portions():
            derivatives = np.tensordot(weights[:3], self.columns[1:, part], axes=1)
            out[part] = derivatives - weights[3] * self.scaled_time(part) * self.about[part] + weights[4]
        return out

    def residual(self) -> Floats:
        """Samples less the model, rad."""
        return by_portions(lambda read, model: read - model - self.offset, self.difference, self.about)


def _correlated(series: Floats, weights: Floats) -> Floats:
    return np.asarray(np.correlate(series, weights.real, "valid") + 1j * np.correlate(series, weights.imag, "valid"))


def expand(
    about: Floats, theta: Floats, bend: Floats, pull: Floats, held: float, frequency: float, shift: float
) -> tuple[Floats, Floats, Floats]:
    """Right-hand side of `z'' + 2 gamma2 z' + held^2 z` expanded about an angle of the difference; all arrays (m,).

    It is `constant + slope (d - about)`, with

        held^2 d - n^2 [(1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d)],  n^2 w = `bend`

    Parameters
    ----------
    pull : (m,) array
        1 + zeta.
    shift : float
        What noise of theta1 adds to the factor of sin d on average, taken off.

    Returns
    -------
    constant, slope : (m,) arrays
    by_frequency : (m,) array
        -d(n^2 [...])/dn.
    """
    sine, less = np.sin(about), -2.0 * np.sin(0.5 * about) ** 2  # cos d - 1
    stiff = frequency**2 * pull / np.cos(theta)
    lever = stiff + bend * np.tan(theta) - shift
    constant = held**2 * about - lever * sine - bend * less
    return constant, held**2 - lever * (1.0 + less) + bend * sine, -2.0 / frequency * stiff * sine
