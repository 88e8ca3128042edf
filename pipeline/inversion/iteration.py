"""Gauss-Newton's iteration on the nonlinear identity: the angle that is expanded about, the recursion, the sums.

The samples are gone through in portions of whole blocks: the recursion's state goes on from one to the next, sums run
over the same blocks wherever portions begin, and what is kept of a long record lies in scratch files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import by_portions, portions, room
from pipeline.arrays import Floats
from pipeline.inversion import kernels, sums
from pipeline.inversion.motion import Motion
from pipeline.observation import Observation
from pipeline.projection.solve import ProjectionFit
from pipeline.projection.taps import NODES, continuation, stencil, taps
from pipeline.projection.uniform import UniformProblem, oscillation

_KEPT, _PASSING = 8, 4  # series that are kept, and those of one portion
_BEYOND = 3  # samples by which the integrals' taps reach beyond an interval, on both sides


class Iteration:
    """What changes from iteration to iteration.

    Parameters
    ----------
    held : ProjectionFit
        The linear fit: its frequency is held in the linear part, its solution starts the iteration.
    gravity : callable
        m/s^2 of a trial n2.
    """

    def __init__(
        self,
        seen: Observation,
        motion: Motion,
        held: ProjectionFit,
        gravity: Callable[[float], float],
    ) -> None:
        self.motion, self._held, self._gravity = motion, held.frequency, gravity
        constants = (held.frequency, seen.frequency_ratio, seen.damping_difference)
        self._linear = UniformProblem(seen.theta, seen.difference, seen.step, *constants)
        self._cardinal = stencil(held.frequency, seen.step)
        self.frequency, self.damping_rate, self.offset = held.frequency, held.damping_rate, float(held.coefficient[2])
        self.difference = seen.difference[motion.inside]
        self.parts, self.count = motion.parts, self.difference.size
        self.half = 0.5 * (self.count - 1) * seen.step
        self._make_room()
        self._gram = np.empty((sums.COLUMNS, sums.COLUMNS))
        self._hold_damping()
        begin = motion.inside.start * seen.step
        self.start = complex(held.coefficient[1], held.coefficient[0]) * np.exp(self.eigenvalue * begin)
        # a later model departs from the readings by little
        self._small = motion.small & self._begin_about()
        # n2 with which the nonlinear pull does the work that the held frequency did
        work = square = 0.0
        for part in self._portions():
            constant, _ = self._expand(part)
            about = self.about[part]
            work, square = work + float(constant @ about), square + float(about @ about)
        self.frequency = float(self._held / np.sqrt(1.0 - work / square / self._held**2))

    def _make_room(self) -> None:
        """Series that are kept, in scratch files where the record is long, and those of one portion."""
        longest = self.parts[0].stop + 2 * NODES + 2 * _BEYOND
        kept, passing = _KEPT * self.count, _PASSING * longest
        if len(self.parts) == 1:
            # one piece of memory: the C library keeps what it was once given back in a large piece, and clears it no
            # more
            whole = np.empty(kept + passing)
            rows, part = whole[:kept], whole[kept:]
        else:
            rows, part = room(kept), np.empty(passing)
        rows = rows.reshape(_KEPT, self.count)
        self.columns: Floats = rows[:4]
        self.about: Floats
        self.slope: Floats
        self.influence: Floats
        self.about, self.slope, self.influence, self.through = rows[4:]
        self._wide, self._by_frequency, *self._integral = part.reshape(_PASSING, longest)

    def _portions(self) -> Iterator[slice]:
        arrays = (self.columns, self.difference, self._response, *self.motion.arrays)
        return portions(self.count, *arrays, unit=kernels.BLOCK)

    def _begin_about(self) -> bool:
        """The readings to expand about; whether all are small."""
        small = True
        for part in self._portions():
            about = self.about[part]
            np.subtract(self.difference[part], self.offset, out=about)
            small &= bool(max(-about.min(), about.max()) < 0.9 * kernels.SMALL)
        return small

    def _hold_damping(self) -> None:
        """Response of the linear part at the present damping."""
        self._linear.respond(self._held, self.damping_rate)
        self._response = self._linear.response[self.motion.inside]
        self.eigenvalue = complex(-self.damping_rate, oscillation(self._held, self.damping_rate))
        weights = taps(self._cardinal, self.eigenvalue, self.motion.step)
        self._taps = weights.real.copy(), weights.imag.copy()
        self._past = past_taps(self.eigenvalue, self.motion.step)

    def _expand(self, part: slice) -> tuple[Floats, Floats]:
        """Expand in some samples: the constant part, and the derivative by n2.

        The former lies within `_wide`, which goes on by a few samples on both sides, beyond the record's ends too.
        """
        motion, low = self.motion, max(part.start - NODES, 0)
        near = slice(low, min(part.stop + NODES, self.count))
        size, skip, length = near.stop - low, part.start - low, part.stop - part.start
        wide, by_frequency = self._wide[: size + 2 * _BEYOND], self._by_frequency[:size]
        constant = wide[_BEYOND:-_BEYOND]
        (kernels.expand_small if self._small else kernels.expand_large)(
            self.about[near],
            motion.low[near],
            motion.curvature[near],
            motion.pull(self._gravity(self.frequency), near),
            self._held,
            self.frequency,
            motion.shift,
            constant,
            self.slope[near],
            by_frequency,
        )
        onward = continuation(self._held, motion.step)
        if low == 0:
            wide[_BEYOND - 1 :: -1] = constant[NODES - 1 :: -1] @ onward
        if near.stop == self.count:
            wide[-_BEYOND:] = constant[-NODES:] @ onward
        return constant[skip : skip + length], by_frequency[skip : skip + length]

    def sweep(self) -> None:
        """Expand, and run the recursion."""
        eigenvalue = self.eigenvalue
        rate, turn = eigenvalue.imag, complex(np.exp(eigenvalue * self.motion.step))
        state = np.array([[self.start.real, self.start.imag, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        state *= rate
        for part in self._portions():
            _, by_frequency = self._expand(part)
            intervals = min(part.stop, self.count - 1) - part.start
            skip = min(part.start, NODES)
            real, imaginary = (row[:intervals] for row in self._integral)
            kernels.interval_integrals(self._wide[skip : skip + intervals + NODES - 1], *self._taps, real, imaginary)
            kernels.recursion(
                real,
                imaginary,
                self.slope[part],
                self.about[part],
                self._response[part],
                by_frequency,
                turn,
                rate,
                self._past,
                state,
                *self._columns(part),
            )

    def _columns(self, part: slice) -> tuple[Floats, Floats, Floats, Floats]:
        """Difference, and tangents by start angle, start rate and n2, of some samples."""
        model, angle, rate, frequency = self.columns
        return model[part], angle[part], rate[part], frequency[part]

    def moments(self) -> Floats:
        """Gram matrix of (start angle, start rate, n2, gamma2, offset, residual)."""
        self._gram[:] = 0.0
        for part in self._portions():
            columns = self._columns(part)
            sums.moments(self.difference[part], *columns, self.offset, part.start, self.count, self._gram)
        return self._gram

    def improve(self, change: Floats) -> None:
        """Follow the tangents to the improved parameters."""
        angle, rate, frequency, damping, offset = change
        for part in self._portions():
            columns = self._columns(part)
            sums.follow(*columns, angle, rate, frequency, damping, part.start, self.count, self.about[part])
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

    def least_squares_influence(self, weights: Floats) -> Floats:
        """d n2 / d (reading of the difference), s-1; see `InversionFit`."""
        for part in self._portions():
            _, angle, rate, frequency = self._columns(part)
            about = self.about[part]
            sums.combined(angle, rate, frequency, weights, about, part.start, self.count, self.influence[part])
        return self.influence

    def residual(self) -> Floats:
        """Readings less the model, rad."""
        return by_portions(lambda read, model: read - model - self.offset, self.difference, self.about)


def past_taps(eigenvalue: complex, step: float) -> Floats:
    """Weights of `int_0^h exp(lam (h - x)) f(x) dx` from f(0) and f(-h), exact for cos and sin at Im(lam); (2, 2)."""
    gamma, oscillation = -eigenvalue.real, eigenvalue.imag
    turn = np.exp(1j * oscillation * step)
    # of f = exp(+-i w x); the first without the small difference of large numbers
    ahead = turn * (step if gamma == 0.0 else -np.expm1(-gamma * step) / gamma)
    behind = (np.conj(turn) - np.exp(eigenvalue * step)) / (gamma - 2j * oscillation)
    now, before = np.linalg.solve(np.array([[1.0, np.conj(turn)], [1.0, turn]]), np.array([ahead, behind]))
    return np.array([[now.real, before.real], [now.imag, before.imag]])
