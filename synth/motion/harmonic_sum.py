"""What every motion becomes: a sum of harmonics of the horizontal acceleration."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from data_schemas.scene_motion import Harmonics, NearResonantMotion
from synth.phase import Floats, Integers, Phasors, full_turn
from synth.propagators.blocks import PeriodicSums

_SPLITTER = (1 << 27) + 1  # leaves half of a double's digits (Dekker 1971)


@dataclass(frozen=True)
class Comb:
    """Harmonics k = 0, 1 ... count - 1 of one period, so many that they are better summed by a Fourier transform."""

    first: int  # Place of k = 0 among all harmonics of the sum
    count: int
    period: Fraction  # s, exact; their frequencies are these multiples, and `angular_frequency` holds them rounded

    @property
    def span(self) -> slice:
        """Places of its harmonics."""
        return slice(self.first, self.first + self.count)

    def frequencies(self) -> tuple[Floats, Floats]:
        """Return 2 pi k/period, (count,) each, rad/s: rounded, and what it is more than that."""
        turn = full_turn(self.period)
        base, more = float(turn), float(turn - Fraction(float(turn)))
        k = np.arange(self.count, dtype=np.float64)
        rounded = k * base
        high = _SPLITTER * base - (_SPLITTER * base - base)
        return rounded, (k * high - rounded) + k * (base - high) + k * more

    def sums(self, *coefficients: Phasors) -> PeriodicSums:
        """Sums of its harmonics with coefficients that are given for all harmonics of the motion."""
        return PeriodicSums(self.period, np.array([each[self.span] for each in coefficients]))


@dataclass(frozen=True)
class HarmonicSum:
    """x''(t) = Re sum acceleration * exp(i angular_frequency t)."""

    angular_frequency: Floats  # (harmonics,) rad/s, not negative; taken as exact, but for those of combs
    acceleration: Phasors  # (harmonics,) amplitude and phase, m/s^2
    combs: tuple[Comb, ...] = ()  # The last harmonics, if they are many multiples of one frequency

    @property
    def alone(self) -> int:
        """How many harmonics, the first ones, belong to no comb."""
        return self.combs[0].first if self.combs else self.angular_frequency.size

    def rest(self, which: Integers) -> Floats:
        """What the frequencies of some harmonics are more than the doubles that stand for them, rad/s."""
        rest = np.zeros(self.angular_frequency.size if self.combs else 0)
        for comb in self.combs:
            rest[comb.span] = comb.frequencies()[1]
        return rest[which] if self.combs else np.zeros(which.size)

    @cached_property
    def transforms(self) -> tuple[PeriodicSums, ...]:
        """The acceleration of every comb."""
        return tuple(comb.sums(self.acceleration) for comb in self.combs)


def add(terms: Iterable[HarmonicSum]) -> HarmonicSum:
    """Sum of motions; combs come last."""
    terms = sorted(terms, key=lambda term: bool(term.combs))
    begins = np.cumsum([0, *(term.angular_frequency.size for term in terms)]).tolist()
    return HarmonicSum(
        np.concatenate([np.empty(0), *(term.angular_frequency for term in terms)]),
        np.concatenate([np.empty(0, dtype=np.complex128), *(term.acceleration for term in terms)]),
        tuple(
            replace(comb, first=begin + comb.first)
            for begin, term in zip(begins, terms, strict=False)
            for comb in term.combs
        ),
    )


def harmonics(term: Harmonics) -> HarmonicSum:
    """Turn the lists of a scene into phasors; a period T becomes 2 pi/T."""
    amplitude = np.array(term.amplitude)
    phase = np.zeros_like(amplitude) if term.phase is None else np.array(term.phase)
    if term.angular_frequency is not None:
        rate = np.array(term.angular_frequency)
    else:
        rate = 2 * math.pi / np.array(term.period)
    return HarmonicSum(rate, amplitude * np.exp(1j * phase))


def near_resonant(term: NearResonantMotion, frequency: float) -> HarmonicSum:
    """Place the harmonic beside a pendulum of frequency n, rad/s."""
    phasor = term.amplitude * complex(np.exp(1j * term.phase))
    return HarmonicSum(np.array([frequency - 2 * term.nu]), np.array([phasor]))
