"""The closed form at many moments, as small matrix products.

Every moment is a block's centre plus an offset inside the block, t = t_b + tau, and every function splits,

    exp(i w t)    = exp(i w t_b) exp(i w tau)
    exp(lambda t) = exp(lambda t_b) exp(lambda tau)
    growth(t)     = growth(t_b) + exp(mu t_b) growth(tau),    growth(t) = (exp(mu t) - 1)/mu

so that all moments are products (blocks x functions) times (functions x offsets), with sines only for the
edges of the table. Nothing accumulates from block to block, so nothing drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from synth.pendulums.linear import Response
from synth.phase import Floats, Phasors
from synth.propagators.blocks import PORTION, Blocks, Halves, general_halves, product

Seconds = tuple[Floats, Floats]
"""t_b and tau, s."""

_SLOW = 1.0
"""Of |mu| times the last moment: a beat that turns less is told by its growth, any other is its two harmonics."""

_TINY = 1e-100
"""Of |mu t|: here the growth is t, and a quotient of still smaller numbers might not be."""


@dataclass(frozen=True)
class _Free:
    """exp(lambda t) (start + sum of gain * growth).

    Attributes
    ----------
    owner : Response
        Whose lambda.
    start : complex
    gain, split : (slow beats,) complex128
        G and mu.
    """

    owner: Response
    start: complex
    gain: Phasors
    split: Phasors

    def halves(self, head: Phasors, table: Phasors, seconds: Seconds) -> Halves:
        """Weights and functions, from exp(i omega t_b), exp(i omega tau), t_b and tau."""
        centres, reaches = seconds
        rate = self.owner.damping_rate
        longest = reaches[-1]  # borrowed from the centres, so that nothing grows beyond bounds
        weights = head * np.exp(-rate * (centres - longest))
        after = table * np.exp(-rate * (longest + reaches))
        before = table.conj() * np.exp(-rate * (longest - reaches))
        if not self.gain.size:
            return general_halves(self.start * weights[None], after[None], before[None])
        split, gain = self.split[:, None], self.gain[:, None]
        own = self.start + np.sum(gain * growth(split, centres), axis=0)
        return general_halves(
            weights * np.vstack([own, gain * np.exp(split * centres)]),
            after * np.vstack([np.ones_like(after), growth(split, reaches)]),
            before * np.vstack([np.ones_like(before), growth(split, -reaches)]),
        )


def series(angular_frequency: Floats, coefficients: Phasors, blocks: Blocks) -> Floats:
    """Real parts of sums of harmonics.

    Parameters
    ----------
    angular_frequency : (harmonics,)
        rad/s
    coefficients : (sums, harmonics)
        Complex amplitudes.
    blocks
        When.

    Returns
    -------
    (sums, blocks, moments) float64
    """
    return _evaluate([(each, None) for each in coefficients], angular_frequency, blocks, blocks.seconds)


def elongation(responses: Sequence[Response], angular_frequency: Floats, blocks: Blocks) -> Floats:
    """Angles of the pendulums, forced and free, but for what combs are transformed to.

    Returns
    -------
    (pendulums, blocks, moments) float64
        rad
    """
    seconds = blocks.seconds
    last = _last(seconds)
    alone = responses[0].alone
    sums = [_pendulum(each, each.forced[:alone].copy(), last) for each in responses]
    return _evaluate(sums, angular_frequency[:alone], blocks, seconds)


def free_harmonic(response: Response, angular_frequency: Floats, blocks: Blocks) -> Phasors:
    """Complex free harmonic Z of one pendulum, near-resonant beats included, but for what combs are transformed to.

    Returns
    -------
    (blocks, moments) complex128
        rad
    """
    seconds = blocks.seconds
    steady, free = _pendulum(response, np.zeros(response.alone, dtype=np.complex128), _last(seconds))
    near = response.near[response.near < response.alone]
    turned = _Free(response, -1j * free.start, -1j * free.gain, free.split)  # its real part is the imaginary one
    sums = [(steady[near], free), (-1j * steady[near], turned)]
    real, imaginary = _evaluate(sums, angular_frequency[near], blocks, seconds)
    result: Phasors = real + 1j * imaginary
    return result


def _pendulum(response: Response, steady: Phasors, last: float) -> tuple[Phasors, _Free]:
    """Add all beats of a pendulum to its steady harmonics, but for those that hardly turn until the last moment."""
    fast = np.abs(response.split) * last >= _SLOW
    if response.combs:
        fast = np.where(response.near < response.alone, fast, response.is_transformed)
    where, gain, split = response.near[fast], response.gain[fast], response.split[fast]
    ratio = gain / split
    alone = np.searchsorted(where, response.alone)
    steady[where[:alone]] = ratio[:alone]
    return steady, _Free(response, response.start - complex(ratio.sum()), response.gain[~fast], response.split[~fast])


def _last(seconds: Seconds) -> float:
    """Largest time before or after t = 0."""
    centres, reaches = seconds
    return float(np.abs(centres).max(initial=0.0) + reaches[-1])


def _evaluate(
    sums: Sequence[tuple[Phasors, _Free | None]], angular_frequency: Floats, blocks: Blocks, seconds: Seconds
) -> Floats:
    """Real parts of sums of harmonics with these coefficients, and of free swings."""
    result = np.empty((len(sums), *blocks.shape))
    for begin in range(0, max(angular_frequency.size, 1), PORTION):
        portion = slice(begin, begin + PORTION)
        rates = angular_frequency[portion].tolist()
        count = len(rates)
        own = [free.owner.damped_frequency for _, free in sums if free] if begin == 0 else []
        head, table = blocks.phasors(rates + own)
        for index, ((steady, free), total) in enumerate(zip(sums, result, strict=True)):
            weights = steady[portion, None] * head[:count]
            # Re(W exp(i w tau)) = Re W cos(w tau) - Im W sin(w tau)
            parts = [Halves(weights.real, table[:count].real, weights.imag, table[:count].imag)]
            if free and begin == 0:
                parts.append(free.halves(head[count + index], table[count + index], seconds))
            product(parts, total, begun=begin > 0)
    return result


def growth(split: Phasors, seconds: Floats) -> Phasors:
    """Return (exp(mu t) - 1)/mu without cancellation; at mu = 0, exact resonance, its limit t.

    Parameters
    ----------
    split : (beats, 1)
        mu
    seconds : (moments,)
        t

    Returns
    -------
    (beats, moments) complex128
    """
    turn = split * seconds
    grown = np.ones_like(turn)
    np.divide(np.expm1(turn), turn, out=grown, where=np.abs(turn) > _TINY)
    grown *= seconds
    return grown
