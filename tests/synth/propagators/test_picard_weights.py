"""Weights of collocation against quadrature with 40 digits, and the remainder against 40-digit functions."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from synth.kernels.collocation import FINE, NODES, Weights, gauss_nodes, interpolation, legendre_tail, weights
from synth.kernels.picard import remainder_of

CASES = [
    (6.21, 0.01, Fraction(1, 2)),
    (6.21, -0.05, Fraction(1, 2)),
    (6.21, 7.0, Fraction(1, 3)),
    (6.21, 0.01, Fraction(1, 2000)),
]


def made_of(frequency: float, damping_rate: float, interval: Fraction) -> Weights:
    """As of a ship's pendulum: rates over n, remainders over n^2."""
    n = Fraction(frequency)
    return weights(n**2, 2 * Fraction(damping_rate), interval, n)


def _mp(value: Fraction) -> mpmath.mpf:
    return mpmath.mpf(value.numerator) / value.denominator


class _Flow:
    """K and K' of one interval, by complex exponentials; time in intervals."""

    def __init__(self, frequency: float, damping_rate: float, interval: Fraction) -> None:
        self.n, self.gamma = frequency * _mp(interval), damping_rate * _mp(interval)
        self.root = mpmath.sqrt(mpmath.mpc(self.gamma**2 - self.n**2))

    def kernel(self, t: mpmath.mpf) -> mpmath.mpf:
        return (mpmath.exp(-self.gamma * t) * mpmath.sinh(self.root * t) / self.root).real

    def slope(self, t: mpmath.mpf) -> mpmath.mpf:
        return (mpmath.exp(-self.gamma * t) * mpmath.cosh(self.root * t)).real - self.gamma * self.kernel(t)


def _lagrange(k: int, x: mpmath.mpf) -> mpmath.mpf:
    nodes = [(1 + mpmath.mpf(int(node)) / FINE) / 2 for node in gauss_nodes()]
    return mpmath.fprod((x - other) / (nodes[k] - other) for other in nodes if other != nodes[k])


@pytest.mark.parametrize("case", CASES)
def test_weights_are_the_integrals(case: tuple[float, float, Fraction]) -> None:
    with mpmath.workdps(40):
        flow, made = _Flow(*case), made_of(*case)
        inner = made.inner[: NODES**2].reshape(NODES, NODES)
        for j, k in ((0, 0), (NODES - 1, 3), (8, 8), (3, NODES - 1)):
            x = (1 + mpmath.mpf(int(gauss_nodes()[j])) / FINE) / 2
            value = flow.n**2 * mpmath.quad(lambda s, x=x, k=k: flow.kernel(x - s) * _lagrange(k, s), [0, x])
            assert abs(inner[k, j] - value) <= 4.0 * 2.0**-52 * np.abs(inner).max()  # a sum of 28 products
        ends = made.end.reshape(4, NODES)
        for k in (0, 7):
            angle = flow.n**2 * mpmath.quad(lambda s, k=k: flow.kernel(1 - s) * _lagrange(k, s), [0, 1])
            speed = flow.n * mpmath.quad(lambda s, k=k: flow.slope(1 - s) * _lagrange(k, s), [0, 1])
            for row, value in ((0, angle), (1, speed)):
                assert (
                    abs(mpmath.mpf(ends[row, k]) + mpmath.mpf(ends[row + 2, k]) - value) <= 1e-18
                )  # long doubles: in the 7200 intervals of an hour below 1e-14 of the remainder


@pytest.mark.parametrize("case", CASES)
def test_propagator_has_twice_the_digits(case: tuple[float, float, Fraction]) -> None:
    with mpmath.workdps(40):
        flow = _Flow(*case)
        stay = flow.slope(1) + 2 * flow.gamma * flow.kernel(1)
        cross = flow.n * flow.kernel(1)
        exact = (stay, cross, -cross, flow.slope(1))
        for (head, tail, leading, rest), value in zip(made_of(*case).propagator.reshape(4, 4), exact, strict=True):
            assert head + tail == leading
            assert abs(mpmath.mpf(leading) + mpmath.mpf(rest) - value) <= 1e-31


def test_interpolation_is_exact_for_polynomials() -> None:
    place = np.array([0.0, 0.1, 0.5, 0.937, 1.0])
    points = np.concatenate([[0.0], (1.0 + gauss_nodes() / FINE) / 2, [1.0]])
    # degree NODES + 1 is the most that start, nodes and end determine
    np.testing.assert_allclose(interpolation(place) @ points ** (NODES + 1), place ** (NODES + 1), rtol=0, atol=4e-16)


def test_interpolation_hits_its_points() -> None:
    points = np.concatenate([[0.0], (1.0 + gauss_nodes() / FINE) / 2, [1.0]])
    np.testing.assert_allclose(interpolation(points), np.eye(NODES + 2), rtol=0, atol=1e-12)
    assert np.array_equal(interpolation(points)[0], np.eye(NODES + 2)[0])


def test_legendre_tail() -> None:
    x = gauss_nodes() / FINE
    values = np.polynomial.legendre.legval(x, np.arange(NODES, dtype=float))
    expected = np.arange(NODES - 4.0, NODES)
    np.testing.assert_allclose(legendre_tail().reshape(4, NODES) @ values, expected, rtol=1e-13)


@pytest.mark.parametrize("largest", [1e-6, 0.02, 0.5, 3.2, 300.0])
def test_remainder(largest: float) -> None:
    """Right to the rounding of theta: r is added to angles of that size."""
    chance = np.random.default_rng(1)
    theta = chance.uniform(-largest, largest, (1, NODES))
    zeta, u, drive = chance.uniform(-0.5, 0.5, (3, 1, NODES))
    known = np.zeros((2, 1, NODES))
    remainder_of(False, theta, zeta, u, drive, 0, 0, known, 1)
    for j in range(NODES):
        with mpmath.workdps(40):
            x = mpmath.mpf(theta[0, j])
            exact = x - (1 + mpmath.mpf(zeta[0, j])) * mpmath.sin(x) + mpmath.mpf(u[0, j]) * (1 - mpmath.cos(x))
            error = abs(known[1, 0, j] - float(exact - mpmath.mpf(drive[0, j])))
        rounding = 2e-16 if largest <= 0.5 else 8e-16
        assert error <= rounding * largest + 3e-16 * abs(drive[0, j])
