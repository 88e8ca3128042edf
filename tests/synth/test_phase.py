from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from synth.phase import damped_frequency, turns


@pytest.mark.parametrize("step", [Fraction(1, 20), Fraction(3, 25), Fraction(86401, 86400 * 25)])
def test_angles_are_exact_after_a_year_of_steps(step: Fraction) -> None:
    rates = [6.2231, 0.6283, 1e-3, 99_999.7]
    index = np.array([0, 1, -1, 72_000, 800_000_000, -800_000_000])
    angles = turns(rates, step).angles(index)
    mpmath.mp.dps = 60
    for rate, row in zip(rates, angles, strict=True):
        for k, angle in zip(index.tolist(), row, strict=True):
            exact = mpmath.mpf(rate) * k * step.numerator / step.denominator
            off = (exact - mpmath.mpf(float(angle))) / (2 * mpmath.pi)
            # one rounding of an angle up to pi, and one of the constant 2 pi/2^64
            assert abs(off - mpmath.nint(off)) * 2 * mpmath.pi < 9e-16


def test_any_fraction_will_do() -> None:
    """2 pi in decimals: nearly a whole turn a second; its denominator is no power of two."""
    given = Fraction("6.2831853071795864769252867665590057683943")
    step, index = Fraction(1, 3), np.array([1, 2, 3, 300_000])
    near = Fraction(round(given * 2**200), 2**200)
    np.testing.assert_array_equal(turns([given], step).angles(index), turns([near], step).angles(index))
    np.testing.assert_allclose(turns([given], step).angles(index)[0, 2:], 0.0, rtol=0, atol=1e-12)
    assert turns([given], step).angles(index)[0, 0] == pytest.approx(2 * math.pi / 3, abs=1e-15)


def test_plain_double_phases_would_not_do() -> None:
    """The reason for the module: after an hour the product w t is off by more than 1e-13 somewhere."""
    step, index = Fraction(1, 20), np.arange(71_000, 72_000)
    exact = turns([6.2231], step).angles(index)[0]
    plain = 6.2231 * (index * 0.05)
    off = (plain - exact + math.pi) % (2 * math.pi) - math.pi
    assert np.max(np.abs(off)) > 1e-13


def test_damped_frequency_beyond_double_precision() -> None:
    mpmath.mp.dps = 60
    exact = mpmath.sqrt(mpmath.mpf(6.2231) ** 2 - mpmath.mpf(1e-3) ** 2)
    omega = damped_frequency(6.2231, 1e-3)
    assert abs(mpmath.mpf(omega.numerator) / omega.denominator - exact) < mpmath.mpf(10) ** -50
    assert damped_frequency(6.2231, 0.0) == Fraction(6.2231)
