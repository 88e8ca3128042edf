"""Moments, even or uneven, and what is asked of them: sums over harmonics, those of long tables by Fourier transform.

Every moment is a block's centre plus an offset, t = t_b + tau, and every function splits,

    exp(i w t)    = exp(i w t_b) exp(i w tau)
    exp(lambda t) = exp(lambda t_b) exp(lambda tau)
    growth(t)     = growth(t_b) + exp(mu t_b) growth(tau),    growth(t) = (exp(mu t) - 1)/mu

so that all moments are products (blocks x functions) times (functions x offsets), and nothing drifts.

Uneven moments: the closed form at Chebyshev nodes of short blocks, interpolated inside each. Over a block of length 2 r
every harmonic with w r <= 4 is a polynomial of degree 27 to 1e-19 (its Chebyshev coefficients are Bessel functions of
w r): interpolation is exact to rounding.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.motion.harmonic_sum import HarmonicSum, Sums
from synth.pendulums.linear import Response
from synth.phase import Floats, Integers, Phasors, rational_turns
from synth.propagators.blocks import Blocks, Places, Ticks, product

Seconds = tuple[Floats, Floats]  # t_b and tau, s

_SLOW = 1.0
"""Of |mu| times the last moment: a beat that turns less is told by its growth, any other is its two harmonics."""

_TINY = 1e-100  # of |mu t|: here the growth is t, and a quotient of still smaller numbers might not be
_NODES = 28
_REACH = 4.0  # largest angle of any harmonic within half a block, rad
_CLOSE = 26  # binary orders of what is split off a period
_FINE = 1 << 40  # nodes and starts are multiples of 2^-40 of a block's half-length: exact integers
Interpolate = Callable[[Floats], Floats]


@dataclass(frozen=True)
class _Free:
    """exp(lambda t) (start + sum of gain * growth)."""

    owner: Response  # whose lambda
    start: complex
    gain: Phasors
    split: Phasors  # (slow beats,) G and mu

    def halves(self, head: Phasors, table: Phasors, seconds: Seconds) -> tuple[Floats, Floats, Floats]:
        """Weights, and functions even and odd, from exp(i omega t_b), exp(i omega tau), t_b and tau."""
        centres, reaches = seconds
        rate = self.owner.damping_rate
        longest = reaches[-1]  # borrowed from the centres, so that nothing grows beyond bounds
        weights = (head * np.exp(-rate * (centres - longest)))[None]
        after = (table * np.exp(-rate * (longest + reaches)))[None]
        before = (table.conj() * np.exp(-rate * (longest - reaches)))[None]
        if self.gain.size:
            split, gain = self.split[:, None], self.gain[:, None]
            own = self.start + np.sum(gain * growth(split, centres), axis=0)
            weights = weights * np.vstack([own, gain * np.exp(split * centres)])
            after = after * np.vstack([np.ones_like(after), growth(split, reaches)])
            before = before * np.vstack([np.ones_like(before), growth(split, -reaches)])
        else:
            weights = self.start * weights
        even, odd = (before + after) / 2, (before - after) / 2
        even, odd = (np.concatenate([each.real, each.imag]) for each in (even, odd))
        return np.concatenate([weights.real, -weights.imag]), even, odd


def _pendulum(response: Response, steady: Phasors, last: float) -> tuple[Phasors, _Free]:
    """Add all beats of a pendulum to its steady harmonics, but for those that hardly turn until the last moment."""
    fast = np.abs(response.split) * last >= _SLOW
    alone = response.motion.sums.alone
    if response.motion.combs:
        fast = np.where(response.near < alone, fast, response.is_transformed)
    where, gain, split = response.near[fast], response.gain[fast], response.split[fast]
    ratio = gain / split
    some = np.searchsorted(where, alone)
    steady[where[:some]] = ratio[:some]
    return steady, _Free(response, response.start - complex(ratio.sum()), response.gain[~fast], response.split[~fast])


def _evaluate(sums: Sequence[tuple[Phasors, _Free | None]], angular_frequency: Floats, blocks: Blocks) -> Floats:
    """Real parts of sums of harmonics with these coefficients, and of free swings."""
    result = np.empty((len(sums), *blocks.shape))
    count = angular_frequency.size
    own = [free.owner.damped_frequency for _, free in sums if free]
    head, table = blocks.phasors([*angular_frequency.tolist(), *own])
    for index, ((steady, free), total) in enumerate(zip(sums, result, strict=True)):
        weights = steady[:, None] * head[:count]
        # Re(W exp(i w tau)) = Re W cos(w tau) - Im W sin(w tau)
        even, odd = [(weights.real, table[:count].real)], [(weights.imag, table[:count].imag)]
        if free:
            own_weights, own_even, own_odd = free.halves(head[count + index], table[count + index], blocks.seconds)
            even.append((own_weights, own_even))
            odd.append((own_weights, own_odd))
        product(even, odd, total)
    return result


def growth(split: Phasors, seconds: Floats) -> Phasors:
    """(exp(mu t) - 1)/mu, (beats, moments), without cancellation; t at mu = 0. `split` (beats, 1) is mu."""
    turn = split * seconds
    grown = np.ones_like(turn)
    np.divide(np.expm1(turn), turn, out=grown, where=np.abs(turn) > _TINY)
    grown *= seconds
    return grown


class Times(ABC):
    """Moments at which sums are evaluated."""

    @abstractmethod
    def places(self, period: Fraction) -> Places:
        """Where in a period the moments lie, (count,), in 2^-64 of it."""

    @abstractmethod
    def _layout(self, fastest: float) -> tuple[Blocks, Interpolate]:
        """Blocks for frequencies up to the fastest, rad/s, and what gives (sums, count) at these moments from values
        (sums, blocks, moments) there."""

    def series(self, angular_frequency: Floats, coefficients: Phasors) -> Floats:
        """Real parts of sums of harmonics (rad/s) with complex amplitudes (sums, harmonics): (sums, count)."""
        blocks, at = self._layout(float(np.max(angular_frequency, initial=1.0)))
        return at(_evaluate([(each, None) for each in coefficients], angular_frequency, blocks))

    def values(self, sums: Sums) -> Floats:
        """Real parts of sums, with those of long tables, (sums, count)."""
        result = self.series(sums.angular_frequency[: sums.alone], sums.coefficients[:, : sums.alone])
        for each in sums.transforms:
            result += each.at(self.places(each.period))
        return result

    def acceleration(self, motion: HarmonicSum) -> Floats:
        """Acceleration of the support, (count,), m/s^2."""
        return np.asarray(self.values(motion.sums)[0])

    def elongation(self, responses: Sequence[Response]) -> Floats:
        """Angles of pendulums that answer one motion, (pendulums, count), rad."""
        rate, blocks, at = self._layout_for(responses)
        sums = [_pendulum(each, each.forced[: rate.size].copy(), blocks.last) for each in responses]
        result = at(_evaluate(sums, rate, blocks))
        for row, response in zip(result, responses, strict=True):
            for each in response.transforms:
                row += each.at(self.places(each.period))[0]
        return result

    def free_harmonic(self, response: Response) -> Phasors:
        """Complex free harmonic Z of one pendulum, near-resonant beats included, (count,), rad."""
        rate, blocks, at = self._layout_for([response])
        steady, free = _pendulum(response, np.zeros(rate.size, dtype=np.complex128), blocks.last)
        near = response.near[response.near < rate.size]
        turned = _Free(response, -1j * free.start, -1j * free.gain, free.split)  # its real part is the imaginary one
        sums = [(steady[near], free), (-1j * steady[near], turned)]
        real, imaginary = at(_evaluate(sums, rate[near], blocks))
        result: Phasors = real + 1j * imaginary
        for each in response.beat_transforms:
            real, imaginary = each.at(self.places(each.period))
            result += real + 1j * imaginary
        return result

    def _layout_for(self, responses: Sequence[Response]) -> tuple[Floats, Blocks, Interpolate]:
        """Frequencies of the harmonics of no comb, rad/s, and the layout for these and the pendulums."""
        motion, own = responses[0].motion, max(response.frequency for response in responses)
        rate = motion.angular_frequency[: motion.sums.alone]
        return rate, *self._layout(float(np.max(rate, initial=own)))


@dataclass(frozen=True)
class EvenTimes(Times):
    """Even moments, as a propagator wants them."""

    step: Fraction  # s, of true time
    count: int
    first: int = 0  # Steps before the first of these moments

    def stretch(self, begin: int, end: int) -> "EvenTimes":
        """The moments from number `begin` up to `end`, counted among these."""
        return EvenTimes(self.step, end - begin, self.first + begin)

    def places(self, period: Fraction) -> Places:
        """See `Times.places`."""
        index = np.arange(self.first, self.first + self.count, dtype=np.int64)
        return np.asarray(rational_turns(self.step / period).wrapped(index)[0])

    def _layout(self, fastest: float) -> tuple[Blocks, Interpolate]:
        """Fewer moments a block than blocks: few sines, and shapes that suit the matrix product.

        Centres lie half-way between two moments, so all counting is in half steps.
        """
        half = max(1, math.isqrt(self.count // 6))
        centres = Ticks.even(2 * (half + self.first) - 1, 4 * half, -(-self.count // (2 * half)))
        blocks = Blocks(centres, Ticks.even(1, 2, half), self.step / 2, self.step / 2)
        return blocks, lambda values: values.reshape(len(values), -1)[:, : self.count]


@dataclass(frozen=True)
class UnevenTimes(Times):
    """Moments in any order."""

    seconds: Floats  # (moments,) time of the chronometer, taken as exact
    scale: Fraction  # True time over the chronometer's

    @property
    def count(self) -> int:
        """Number of moments."""
        return self.seconds.size

    def stretch(self, begin: int, end: int) -> "UnevenTimes":
        """The moments from number `begin` up to `end`."""
        return UnevenTimes(self.seconds[begin:end], self.scale)

    def places(self, period: Fraction) -> Places:
        """See `Times.places`; split at exact times so close together that what is left needs no care."""
        length = math.ldexp(1.0, math.frexp(float(period))[1] - _CLOSE)
        number = np.floor(self.seconds / length)
        left = (self.seconds - number * length) * float(self.scale / period * 2**64)
        whole = rational_turns(Fraction(length) * self.scale / period).wrapped(number.astype(np.int64))[0]
        return np.asarray(whole + np.rint(left).astype(np.uint64))

    def _layout(self, fastest: float) -> tuple[Blocks, Interpolate]:
        """Blocks that hold the moments; half their length is a power of two, so that they start at exact times."""
        half = math.ldexp(1.0, math.frexp(_REACH / (fastest * float(self.scale)))[1] - 1)
        number = np.floor(self.seconds / (2 * half)).astype(np.int64)  # of the block that each moment lies in
        used, row = np.unique(number, return_inverse=True)
        unit, nodes = Fraction(half) * self.scale, _nodes()
        blocks = Blocks(Ticks(2 * used + 1), Ticks(nodes[_NODES // 2 :]), unit, unit / _FINE)
        place = (self.seconds - (2 * number + 1) * half) / half

        def interpolate(values: Floats) -> Floats:
            polynomials = np.polynomial.chebyshev.chebvander(nodes / _FINE, _NODES - 1)
            coefficients = values @ np.linalg.inv(polynomials).T
            basis = np.polynomial.chebyshev.chebvander(place, _NODES - 1)
            return np.array([np.einsum("ij,ij->i", basis, each[row]) for each in coefficients])

        return blocks, interpolate


def _nodes() -> Integers:
    """Chebyshev nodes, increasing and even about zero, in units of 2^-40."""
    angles = (2 * np.arange(_NODES // 2) + 1) * math.pi / (2 * _NODES)
    after = np.rint(np.cos(angles[::-1]) * _FINE).astype(np.int64)
    return np.concatenate([-after[::-1], after])
