"""Weights of the identity against arbitrary-precision integrals and elementary solutions."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from exact_pair import Pair

from pipeline.methods.identity import NODES, Identity, basis, cardinal, padded, taps

N = 2.0 * np.pi / 1.01
CENTRE = 0.5 * (NODES - 1)


def exact_integral(name: str, power: int, left: float, step: float, lam: complex) -> complex:
    """`int_0^h exp(lam (h - x)) z^p {1, cos, sin}(n z h) dx`, z in steps from the stencil's centre."""
    mpmath.mp.dps = 30

    def inner(x: mpmath.mpf) -> mpmath.mpc:
        z = left + x / step
        wave = {"one": lambda a: mpmath.mpf(1), "cos": mpmath.cos, "sin": mpmath.sin}[name](N * step * z)
        return mpmath.exp(lam * (step - x)) * z**power * wave

    return complex(mpmath.quad(inner, [0, step]))


@pytest.mark.parametrize("rate", [10.0, 25.0, 100.0])
@pytest.mark.parametrize(
    ("name", "power"),
    [("one", 0), ("one", 1), ("one", 2), ("one", 3), ("cos", 0), ("sin", 0), ("cos", 1), ("sin", 1)],
)
def test_taps_are_exact_on_their_basis(name: str, power: int, rate: float) -> None:
    step = 1.0 / rate
    lam = complex(-1e-4, np.sqrt(N**2 - 1e-8))
    values = _basis_function(name, power, np.arange(NODES) - CENTRE, step)
    exact = exact_integral(name, power, -0.5, step, lam)
    assert abs(taps(lam, N, step) @ values - exact) < 2e-12 * step


@pytest.mark.parametrize("rate", [10.0, 25.0, 100.0])
@pytest.mark.parametrize(("name", "power"), [("one", 0), ("one", 3), ("cos", 0), ("sin", 0), ("cos", 1), ("sin", 1)])
def test_a_series_is_continued_exactly_on_the_basis(name: str, power: int, rate: float) -> None:
    z = np.arange(NODES + 3) - CENTRE
    values = _basis_function(name, power, z, 1.0 / rate)
    onward, back = (padded(each, N, 1.0 / rate) for each in (values[:NODES], values[3:]))
    # the continuing weights' own rounding
    scale = 1e-16 * np.abs(cardinal(np.arange(3.0) + 4.5, N / rate)).sum() * np.abs(values).max()
    assert np.abs(onward[3:] - values).max() < 100 * scale
    assert np.abs(back[:-3] - values).max() < 100 * scale


def _basis_function(name: str, power: int, z: np.ndarray, step: float) -> np.ndarray:
    wave = {"one": np.ones_like, "cos": np.cos, "sin": np.sin}[name](N * step * z)
    return np.asarray(z**power * wave)


def test_taps_away_from_the_fitted_frequency_keep_the_order() -> None:
    """Swell and a detuned swing are not in the basis: eight points leave 2e-9 of swell of 10 s at 10 Hz."""
    step, lam = 0.1, 1j * N * 1.0001
    own = taps(lam, N, step)
    z = np.arange(NODES) - CENTRE
    for m, limit in ((2 * np.pi / 10.0, 3e-9), (2 * np.pi / 4.0, 1e-6), (N * 1.001, 1e-9)):
        exact = complex(
            mpmath.quad(lambda x, m=m: mpmath.exp(lam * (step - x)) * mpmath.cos(m * (x - 0.05)), [0, step])
        )
        assert abs(own @ np.cos(m * step * z) - exact) < limit * step


@pytest.mark.parametrize("angle", [0.01, 0.2, 0.57, 0.58, 1.2])
def test_weights_are_right_and_small_however_fast_the_sampling(angle: float) -> None:
    """At 0.01 rad a step the eight functions are dependent to rounding."""
    nodes = np.arange(NODES) - CENTRE
    node, _ = np.polynomial.legendre.leggauss(16)
    own = cardinal(0.5 * node, angle).T
    for function in (np.cos, np.sin, lambda x: x * np.cos(x), lambda x: x * np.sin(x), lambda x: x**3):
        assert np.abs(own @ function(angle * nodes) - function(angle * 0.5 * node)).max() < 1e-10
    assert np.abs(own).sum(axis=1).max() < 2.0


def test_two_nodes_are_exact_for_a_swing() -> None:
    step = 0.04
    lam = complex(-2e-3, 6.2)
    own = taps(lam, 6.2, step, count=2)
    nodes, gauss = np.polynomial.legendre.leggauss(20)
    x = 0.5 * step * (nodes + 1.0)
    kernel = 0.5 * step * gauss * np.exp(lam * (step - x))
    for wave in (np.cos, np.sin):
        assert abs(own @ wave(6.2 * np.array([0.0, step])) - kernel @ wave(6.2 * x)) < 1e-15


def _swing(count: int, step: float, seed: int = 3) -> np.ndarray:
    random = np.random.default_rng(seed)
    t = np.arange(count) * step
    return 0.01 * np.cos(N * t + 0.3) + 0.05 * np.cos(2 * np.pi * t / 8.0 + random.uniform(0, 6))


def identity(theta: np.ndarray, step: float, held: float, ratio: float, apart: float) -> Identity:
    seen = Pair((held * ratio, held), (apart, 0.0)).observe(np.arange(theta.size) * step, step=step, theta=theta)
    return Identity(seen, held, slice(None))


def missing(of: Identity, gamma: float, difference: np.ndarray, right: np.ndarray | float = 0.0) -> np.ndarray:
    """What is missing to the identity at a difference, rad a sample."""
    return of.defect(of.weights(gamma), difference, np.zeros(difference.size) + right)


def one_sided(row: int, lam: complex, step: float) -> np.ndarray:
    """Weights of the eight nodes for the interval from node `row` to the next, by the functions' own integrals."""
    node, weight = np.polynomial.legendre.leggauss(20)
    x = 0.5 * (node + 1.0)
    kernel = 0.5 * step * weight * np.exp(lam * step * (1.0 - x))
    matrix = basis(np.arange(NODES) - CENTRE, N * step)
    return np.linalg.solve(matrix, basis(row - CENTRE + x, N * step) @ kernel)


@pytest.mark.parametrize("count", [8, 9, 255, 257, 600, 1601])
def test_identity_holds_for_the_running_integral(count: int) -> None:
    """Against one plain recursion of the complex state, without continued ends."""
    step, gamma, ratio, apart = 0.1, 2e-4, 1.001, 1e-4
    theta, r = _swing(count, step), ratio**-2
    lam = complex(-gamma, np.sqrt(N**2 - gamma**2))
    gain = ((1.0 - r) * lam**2 + 2.0 * (gamma - r * (gamma + apart)) * lam) / lam.imag
    own = [one_sided(row, lam, step) for row in range(NODES - 1)]
    c, expected = 0j, [(1.0 - r) * theta[0]]
    for k in range(count - 1):
        row = k if k < 3 else (3 if k < count - 4 else k - count + 8)
        start = 0 if k < 3 else min(k - 3, count - 8)
        c = np.exp(lam * step) * c + own[row] @ theta[start : start + 8]
        expected.append((1.0 - r) * theta[k + 1] + (gain * c).imag)
    assert np.abs(missing(identity(theta, step, N, ratio, apart), gamma, np.array(expected))).max() < 1e-16


@pytest.mark.parametrize("gamma", [0.0, 3e-4])
def test_identity_holds_for_a_forced_and_a_free_motion(gamma: float) -> None:
    """`d'' + 2 g2 d' + n^2 d = (1-r) theta'' + 2 (g2 - r g1) theta'` has elementary solutions for a harmonic."""
    step, ratio, apart, m = 0.05, 1.001, 1e-4, 2 * np.pi / 9.0
    t = np.arange(1500) * step
    r, g1 = ratio**-2, gamma + apart
    transfer = ((1 - r) * -(m**2) + 2 * (gamma - r * g1) * 1j * m) / (N**2 - m**2 + 2j * gamma * m)
    forced = (transfer * np.exp(1j * m * t)).real
    free = (0.01 * np.exp(complex(-gamma, np.sqrt(N**2 - gamma**2)) * t)).real
    of = identity(np.cos(m * t), step, N, ratio, apart)
    assert np.abs(missing(of, gamma, forced + free)).max() < 1e-14  # of theta1 1 rad; most at the ends
    assert np.abs(missing(of, gamma, free)).max() > 1e-7  # theta1 is felt


def test_a_right_hand_side_moves_the_frequency() -> None:
    """A free swing of another n2 solves the identity with `N = (h^2 - n2^2) d`."""
    step, held, n = 0.05, N, N * 1.0003
    t = np.arange(1500) * step
    swing = 0.01 * np.cos(n * t + 0.3)
    found = missing(identity(np.zeros(t.size), step, held, 1.0, 0.0), 0.0, swing, (held**2 - n**2) * swing)
    assert np.abs(found).max() < 4e-15
    assert np.abs(missing(identity(np.zeros(t.size), step, held, 1.0, 0.0), 0.0, swing)).max() > 1e-7
