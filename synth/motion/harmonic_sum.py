"""What every motion becomes: a sum of harmonics of the acceleration; as it is given, or drawn as a wind sea.

Spectrum of a sea, JONSWAP (G = 3.3) or Pierson-Moskowitz (G = 1):

    S(x) = x^-5 exp(-5/4 x^-4) G^exp(-(x - 1)^2/(2 s^2)),  x = w/w_peak,  s = 0.07 below the peak, 0.09 above

It is scaled so that the whole of it, 0 to infinity, has the given significant height (Hasselmann et al. 1973 fix
alpha = 0.0081 as well; the three conflict). In deep water, k = w^2/g, a wave of amplitude a moves a vessel at depth d
with an acceleration of amplitude a w^2 exp(-k d), horizontal and vertical.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from data_schemas.scene_motion import Harmonics, NearResonantMotion, SeaMotion
from synth.phase import Floats, Integers, Phasors, full_turn
from synth.propagators.blocks import PeriodicSums

_SPLITTER = (1 << 27) + 1  # leaves half of a double's digits (Dekker 1971)
PEAK_FACTOR = {"jonswap": 3.3, "pierson-moskowitz": 1.0}
LOWEST = 0.5  # Lowest frequency of a sea, as a multiple of the peak's: below it lies 2e-9 of the variance
_TOP = 40.0  # end of the numerical integral; beyond it the spectrum is x^-5 and its integral x^-4/4
_POINTS = 20_001


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
class Sums:
    """Several sums over the same harmonics."""

    angular_frequency: Floats  # (harmonics,) rad/s
    coefficients: Phasors  # (sums, harmonics)
    combs: tuple[Comb, ...] = ()  # The last harmonics, if they are many multiples of one frequency

    @property
    def alone(self) -> int:
        """How many harmonics, the first ones, belong to no comb."""
        return self.combs[0].first if self.combs else self.angular_frequency.size

    @cached_property
    def transforms(self) -> tuple[PeriodicSums, ...]:
        """All sums over every comb."""
        return tuple(comb.sums(*self.coefficients) for comb in self.combs)

    def some(self, which: slice) -> "Sums":
        """Some of the sums."""
        return Sums(self.angular_frequency, self.coefficients[which], self.combs)


@dataclass(frozen=True)
class HarmonicSum:
    """x''(t) = Re sum acceleration * exp(i angular_frequency t)."""

    angular_frequency: Floats  # (harmonics,) rad/s, not negative; taken as exact, but for those of combs
    acceleration: Phasors  # (harmonics,) amplitude and phase, m/s^2
    combs: tuple[Comb, ...] = ()  # The last harmonics, if they are many multiples of one frequency

    def rest(self, which: Integers) -> Floats:
        """What the frequencies of some harmonics are more than the doubles that stand for them, rad/s."""
        rest = np.zeros(self.angular_frequency.size if self.combs else 0)
        for comb in self.combs:
            rest[comb.span] = comb.frequencies()[1]
        return rest[which] if self.combs else np.zeros(which.size)

    @cached_property
    def sums(self) -> Sums:
        """The acceleration as one sum."""
        return Sums(self.angular_frequency, self.acceleration[None], self.combs)


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


def spectral_shape(relative_frequency: Floats, peak_factor: float) -> Floats:
    """S(x) of the formula above for x = w/w_peak above 0, without the scale; the peak factor is G."""
    x = relative_frequency
    width = np.where(x <= 1, 0.07, 0.09)
    peak = np.exp(-((x - 1) ** 2) / (2 * width**2))
    return np.asarray(x**-5 * np.exp(-1.25 * x**-4) * peak_factor**peak)


def bin_variances(edges: Floats, spectrum: str, significant_height: float) -> Floats:
    """Variance of the sea's elevation in bins of frequency, m^2; `spectrum` is a key of PEAK_FACTOR.

    Edges are multiples of the peak frequency, increasing, from LOWEST to at most 40; the significant height is in m.
    """
    x = np.geomspace(LOWEST / 2, _TOP, _POINTS)
    density = spectral_shape(x, PEAK_FACTOR[spectrum])
    below = np.concatenate([[0.0], np.cumsum(np.diff(x) * (density[1:] + density[:-1]) / 2)])
    whole = below[-1] + _TOP**-4 / 4
    return np.asarray(np.diff(np.interp(edges, x, below)) / whole * (significant_height**2 / 16))


def sea(term: SeaMotion, gravity: float, chance: np.random.Generator) -> HarmonicSum:
    """Draw a sea: the frequency of each harmonic evenly inside its bin, so that the record does not repeat itself.

    Amplitudes follow from the variance of equally wide bins. Gravity, m/s^2, is for the wave number.
    """
    peak = 2 * math.pi / term.peak_period
    edges = np.linspace(LOWEST, term.cutoff, term.components + 1)
    elevation = np.sqrt(2 * bin_variances(edges, term.spectrum, term.significant_height))
    rate = peak * (edges[:-1] + np.diff(edges) * chance.random(term.components))
    phase = 2 * math.pi * chance.random(term.components)
    at_depth = elevation * rate**2 * np.exp(-(rate**2) / gravity * term.depth)
    # on the orbits of deep water the vertical acceleration leads the horizontal by a quarter, whatever the direction
    slant = math.radians(term.direction)
    share = {"vertical": 1j, "horizontal": math.cos(slant), "transverse": math.sin(slant)}[term.axis]
    return HarmonicSum(rate, share * at_depth * np.exp(1j * phase))
