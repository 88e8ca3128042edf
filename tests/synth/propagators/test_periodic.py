"""Long tables: sums over thousands of multiples of one frequency, against direct sums and 40-digit arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from data_schemas.scene_pendulum import FreeStart, StateStart
from synth.motion import tabulated
from synth.motion.harmonic_sum import HarmonicSum, Sums, add
from synth.motion.tabulated import continued
from synth.pendulums.linear import respond
from synth.propagators.blocks import PeriodicSums
from synth.propagators.times import EvenTimes, UnevenTimes

N = 2 * math.pi / 1.01
GRAVITY = 9.81
START = StateStart(angle=0.02, angular_velocity=-0.03)


@pytest.mark.parametrize("count", [1, 2, 7, 300, 1500])
def test_transform_is_the_sum(count: int) -> None:
    chance = np.random.default_rng(count)
    coefficients = chance.normal(size=(2, count)) + 1j * chance.normal(size=(2, count))
    edges = np.array([0, 1, 2**63, 2**64 - 1], dtype=np.uint64)
    places = np.concatenate([edges, chance.integers(0, 2**64, 700, dtype=np.uint64)])
    turns = places[:, None] * np.arange(count, dtype=np.uint64)  # modulo a turn, exact
    angles = turns.view(np.int64) * (2 * math.pi / 2**64)
    exact = (np.exp(1j * angles) @ coefficients.T).real.T
    found = PeriodicSums(Fraction(1), coefficients).at(places)
    assert np.abs(found - exact).max() < 3e-15 * np.abs(exact).max()  # a dozen roundings


@pytest.mark.parametrize("period", [Fraction(1251, 10), Fraction(108_000) / 7])
def test_places_are_exact_for_a_year(period: Fraction) -> None:
    """A harmonic of 1e5 multiples: what is off in the place, times 2 pi 1e5, is an error of its phase."""
    seconds = np.array([-3.0, 0.0, 17.1, 86_399.96, 3.2e7 + 0.1])
    scale = 1 + Fraction(7, 86_400)
    uneven = UnevenTimes(seconds, scale).places(period).tolist()
    for place, time in zip(uneven, seconds.tolist(), strict=True):
        assert _off(place, Fraction(time) * scale / period) * 2 * math.pi * 1e5 < 1e-13
    step, first = Fraction(86_401, 86_400 * 25), 800_000_000
    for k, place in enumerate(EvenTimes(step, 3, first).places(period).tolist()):
        assert _off(place, (first + k) * step / period) * 2 * math.pi * 1e5 < 1e-13


def _off(place: int, turns: Fraction) -> float:
    off = Fraction(place, 1 << 64) - turns
    return abs(float(off - round(off)))


def _table(readings: int = 1700, step: float = 0.1, delay: float = 3.0) -> HarmonicSum:
    values = 0.05 * np.random.default_rng(readings).normal(size=readings)
    motion = continued(values, step, delay)
    assert len(motion.combs) == 1
    return motion


def _exact(motion: HarmonicSum, n: float, gamma: float, seconds: list[Fraction]) -> np.ndarray:
    """Steady answer to every harmonic of the table, the rest by the start, in 40 digits."""
    with mpmath.workdps(40):
        comb = motion.combs[0]
        base = 2 * mpmath.pi * comb.period.denominator / comb.period.numerator
        own, loss = mpmath.mpf(n), mpmath.mpf(gamma)
        omega = mpmath.sqrt(own**2 - loss**2)
        steady = []
        for k, push in enumerate(motion.acceleration.tolist()):
            w = k * base
            answer = (own - w) * (own + w) + mpmath.mpc(0, 2) * loss * w
            steady.append((w, -(own**2) * mpmath.mpc(push) / mpmath.mpf(GRAVITY) / answer))
        left = START.angle - mpmath.fsum(c.real for _, c in steady)
        rising = START.angular_velocity + mpmath.fsum(w * c.imag for w, c in steady)
        free = mpmath.mpc(left, -(rising + loss * left) / omega)
        values = []
        for each in seconds:
            t = mpmath.mpf(each.numerator) / each.denominator
            turn, phase, total = mpmath.expj(base * t), mpmath.mpc(1), mpmath.mpf(0)
            for _, c in steady:
                total += (c * phase).real
                phase *= turn
            values.append(float(total + (free * mpmath.exp(mpmath.mpc(-loss, omega) * t)).real))
    return np.array(values)


@pytest.mark.parametrize("gamma", [0.0, 1e-3])
@pytest.mark.parametrize("on_a_harmonic", [False, True])
def test_pendulum_moved_by_a_long_table(gamma: float, on_a_harmonic: bool) -> None:
    """Through the band of beats, also with a harmonic of the table within a rounding of n."""
    motion = _table()
    w = motion.angular_frequency
    n = float(w[np.argmin(np.abs(w - N))]) if on_a_harmonic else N
    response = respond(n, gamma, START, motion, GRAVITY)
    assert response.near.size > 50
    assert 0 < np.count_nonzero(~response.is_transformed) < 5
    even = EvenTimes(Fraction(1, 16), 2600)  # moments that are doubles
    picked = [0, 1, 700, 1311, 2599]
    exact = _exact(motion, n, gamma, [Fraction(k, 16) for k in picked])
    theta = even.elongation([response])[0]
    size = np.abs(theta).max()
    assert np.abs(theta[picked] - exact).max() < 3e-15 * size
    uneven = UnevenTimes(np.array(picked) / 16, Fraction(1))
    assert np.abs(uneven.elongation([response])[0] - exact).max() < 3e-15 * size
    for times in (even, uneven):
        parts = times.free_harmonic(response).real + times.values(Sums(w, response.forced[None], motion.combs))[0]
        np.testing.assert_allclose(parts, times.elongation([response])[0], rtol=0, atol=3e-15 * size)


def test_stretches_make_the_whole() -> None:
    motion = _table()
    response = respond(N, 1e-3, START, motion, GRAVITY)
    times = EvenTimes(Fraction(1, 25), 4000)
    whole = times.elongation([response])
    parts = [times.stretch(*each).elongation([response]) for each in ((0, 1500), (1500, 4000))]
    np.testing.assert_allclose(np.hstack(parts), whole, rtol=0, atol=1e-15)


def test_a_table_beside_other_motions() -> None:
    """Harmonics in and out of the band, and two tables: the answer to all is the sum of the answers."""
    swell = HarmonicSum(np.array([0.6, 1.1, N - 0.05]), np.array([0.1, 0.05j, 8e-4]))
    terms = [_table(), swell, _table(1800)]
    start = FreeStart(amplitude=0.0, phase=0.0)
    for times in (EvenTimes(Fraction(1, 16), 900), UnevenTimes(np.linspace(0.0, 50.0, 77), Fraction(1))):
        together = add(terms)
        assert together.sums.alone == 3
        response = respond(N, 1e-3, start, together, GRAVITY)
        apart = [respond(N, 1e-3, start, each, GRAVITY) for each in terms]
        for found, expected in (
            (times.acceleration(together), sum(times.acceleration(each) for each in terms)),
            (
                times.elongation([response])[0],
                sum(times.elongation([each])[0] for each in apart),
            ),
            (
                times.free_harmonic(response),
                sum(times.free_harmonic(each) for each in apart),
            ),
        ):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(found).max())


def test_a_long_table_is_what_its_harmonics_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same table, harmonic by harmonic: doubles stand for the frequencies there, 1e-13 of a phase in 200 s."""
    motion = _table()
    monkeypatch.setattr(tabulated, "LONG", 10_000)
    values = 0.05 * np.random.default_rng(1700).normal(size=1700)
    alone = continued(values, 0.1, 3.0)
    assert not alone.combs
    times = EvenTimes(Fraction(1, 25), 4000)
    np.testing.assert_allclose(times.acceleration(motion), times.acceleration(alone), rtol=0, atol=1e-13)
    both = [respond(N, 1e-3, START, each, GRAVITY) for each in (motion, alone)]
    theta = [times.elongation([each])[0] for each in both]
    np.testing.assert_allclose(theta[0], theta[1], rtol=0, atol=1e-12 * np.abs(theta[0]).max())


def test_a_day_passes_through_every_reading() -> None:
    """86400 readings, one a second: 54001 harmonics."""
    values = np.random.default_rng(8).normal(size=86_400)
    motion = continued(values, 1.0, 100.0)
    found = EvenTimes(Fraction(1), 86_300).acceleration(motion)
    # moments are whole numbers of 2^-64 of 30 hours, 6e-15 s, and this noise changes by 4 in a second
    np.testing.assert_allclose(found, values[100:], rtol=0, atol=5e-14)
