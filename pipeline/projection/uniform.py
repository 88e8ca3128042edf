"""Uniform samples: the response by full sweeps over the samples, and the moments of what it leaves."""

from __future__ import annotations

import functools

import numpy as np

from data_schemas.scratch import portions, release, room
from pipeline.arrays import Floats
from pipeline.projection import kernels
from pipeline.projection.taps import NODES, continuation, stencil, taps


def response_constants(frequency: float, gamma: float, ratio: float, damping_difference: float) -> tuple[complex, ...]:
    """Eigenvalue lam, direct gain, gain and its slopes by n2 and gamma2, of `response = direct theta + Im(gain c)`.

    c is the running integral of exp(lam (t-s)) theta; gain = [(1-r) lam^2 + 2 (gamma2 - r gamma1) lam] / w.
    """
    r = ratio**-2
    oscillation = np.sqrt(frequency**2 - gamma**2)
    eigenvalue = complex(-gamma, oscillation)
    drag = 2.0 * (gamma * (1.0 - r) - r * damping_difference)
    gain = ((1.0 - r) * eigenvalue**2 + drag * eigenvalue) / oscillation
    # d/dw of gain at fixed gamma: d lam = i dw
    slope = (2.0j * (1.0 - r) * eigenvalue + 1j * drag) / oscillation - gain / oscillation
    return eigenvalue, 1.0 - r, gain, slope, -drag / oscillation


def oscillation(frequency: float, gamma: float) -> float:
    """w of `w^2 = n^2 - gamma^2`."""
    return float(np.sqrt(frequency**2 - gamma**2))


class UniformProblem:
    """Uniform samples of both series, none missing.

    The samples are gone through in portions of whole blocks. What a portion starts from, the state of the recursion,
    is kept, so that the response of any portion can be had again and need not be stored; the numbers do not depend on
    where portions begin.

    Attributes
    ----------
    parts : list of slice
        The samples of the portions.
    slopes : (blocks + 1, 2) array
        Those of the response by n2 and gamma2 at the blocks' starts and at the end, as `kernels.moments` has them; of
        the portions asked for.
    half : float
        Half the record's length, s.
    """

    def __init__(
        self,
        theta: Floats,
        difference: Floats,
        step: float,
        fitted_at: float,
        ratio: float,
        damping_difference: float,
    ) -> None:
        self._theta, self._difference, self._step = theta, difference, step
        self._ratio, self._damping_difference = ratio, damping_difference
        self._cardinal = stencil(fitted_at, step)
        onward = continuation(fitted_at, step)
        self._beyond = theta[NODES - 1 :: -1] @ onward, theta[-NODES:] @ onward
        self.block = kernels.block_length(theta.size)
        self.parts = list(portions(theta.size, theta, unit=self.block))
        self._state = np.empty((-(-theta.size // self.block) + 1, 2), dtype=np.complex128)
        self.slopes = np.zeros_like(self._state)
        self._starts = np.empty(len(self.parts))  # the response at the first sample of each portion
        self._response: Floats = np.empty(self.parts[0].stop + 1)
        self._held = -1  # the portion whose response that is
        self._gram = np.empty((kernels.COLUMNS, kernels.COLUMNS))
        self._amounts = np.zeros(kernels.COLUMNS - 1)
        self.half = 0.5 * (theta.size - 1) * step

    @functools.cached_property
    def residual(self) -> Floats:
        """What the last `moments` found at every sample."""
        return room(self._theta.size)

    def respond(self, frequency: float, gamma: float) -> None:
        """Compute the response to the first pendulum, and its slopes, at (n2, gamma2)."""
        self._constants = response_constants(frequency, gamma, self._ratio, self._damping_difference)
        weights = taps(self._cardinal, self._constants[0], self._step)
        self._taps = weights.real.copy(), weights.imag.copy()
        self._amounts[5:] = 0.0
        self._state[0] = 0.0
        self._starts[0] = self._constants[1].real * self._theta[0]
        self._held = -1
        if len(self.parts) == 1:
            self.part(0)

    def part(self, number: int) -> Floats:
        """The response of one portion, to be read before the next; the first time they are asked for in order."""
        samples = self.parts[number]
        first, last = samples.start // self.block, -(-samples.stop // self.block)
        if number != self._held:
            eigenvalue, direct, gain, by_frequency, by_damping = self._constants
            self._response[0] = self._starts[number]
            state = self._state[first : last + 1]
            kernels.forced_response(
                self._theta,
                *self._beyond,
                *self._taps,
                self._step,
                self.block,
                eigenvalue,
                direct.real,
                gain,
                first,
                self._response,
                state,
            )
            if number + 1 < len(self.parts):
                self._starts[number + 1] = self._response[samples.stop - samples.start]
            slopes = self.slopes[first : last + 1]
            slopes[:, 0] = state[:, 0] * by_frequency + state[:, 1] * (1j * gain)
            slopes[:, 1] = state[:, 0] * by_damping - state[:, 1] * gain
            self._held = number
            release(self._theta)
        return self._response[: samples.stop - samples.start]

    @property
    def response(self) -> Floats:
        """The response at all samples."""
        if len(self.parts) == 1:
            return self.part(0)
        whole = room(self._theta.size)
        for number, samples in enumerate(self.parts):
            whole[samples] = self.part(number)
            release(whole)
        return whole

    def nudge(self, frequency_change: float, damping_change: float) -> None:
        """Take the response to nearby (n2, gamma2) by its slopes."""
        self._amounts[5:] += frequency_change, damping_change

    def moments(self, frequency: float, gamma: float, coefficient: Floats) -> Floats:
        """Gram matrix (8, 8) as `kernels.moments` has it; `coefficient` (3,) is (A, B, offset)."""
        self._gram[:] = 0.0
        self._amounts[:3] = coefficient
        for number, samples in enumerate(self.parts):
            response = self.part(number)
            first, last = samples.start // self.block, -(-samples.stop // self.block)
            kernels.moments(
                self._difference[samples],
                response,
                self.slopes[first : last + 1],
                self._step,
                self.block,
                complex(-gamma, oscillation(frequency, gamma)),
                self._amounts,
                first,
                self._theta.size,
                self.residual[samples],
                self._gram,
            )
            release(self._difference, self.residual)
        return self._gram
