"""Taps of the projection against arbitrary-precision integrals, and its sweeps against plain sums."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from pipeline.projection.identity import LinearIdentity, response_constants
from pipeline.projection.taps import CENTRE, NODES, continuation, fitted_basis, stencil, taps

N = 2.0 * np.pi / 1.01


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
    assert abs(taps(stencil(N, step), lam, step) @ values - exact) < 2e-12 * step


@pytest.mark.parametrize("rate", [10.0, 25.0, 100.0])
@pytest.mark.parametrize(("name", "power"), [("one", 0), ("one", 3), ("cos", 0), ("sin", 0), ("cos", 1), ("sin", 1)])
def test_a_series_is_continued_exactly_on_the_basis(name: str, power: int, rate: float) -> None:
    z = np.arange(NODES + 3) - CENTRE
    values = _basis_function(name, power, z, 1.0 / rate)
    onward = continuation(N, 1.0 / rate)
    scale = 1e-16 * np.abs(onward).sum() * np.abs(values).max()
    assert np.abs(values[:NODES] @ onward - values[NODES:]).max() < 100 * scale  # the weights' own rounding


def _basis_function(name: str, power: int, z: np.ndarray, step: float) -> np.ndarray:
    wave = {"one": np.ones_like, "cos": np.cos, "sin": np.sin}[name](N * step * z)
    return np.asarray(z**power * wave)


def test_taps_away_from_the_fitted_frequency_keep_the_order() -> None:
    """Swell and a detuned swing are not in the basis: eight points leave 2e-9 of swell of 10 s at 10 Hz."""
    step, lam = 0.1, 1j * N * 1.0001
    weights = taps(stencil(N, step), lam, step)
    z = np.arange(NODES) - CENTRE
    for m, limit in ((2 * np.pi / 10.0, 3e-9), (2 * np.pi / 4.0, 1e-6), (N * 1.001, 1e-9)):
        exact = complex(
            mpmath.quad(lambda x, m=m: mpmath.exp(lam * (step - x)) * mpmath.cos(m * (x - 0.05)), [0, step])
        )
        assert abs(weights @ np.cos(m * step * z) - exact) < limit * step


@pytest.mark.parametrize("angle", [0.01, 0.2, 0.57, 0.58, 1.2])
def test_weights_are_right_and_small_however_fast_the_sampling(angle: float) -> None:
    """At 0.01 rad a step the eight functions are dependent to rounding."""
    nodes = np.arange(NODES) - CENTRE
    node, _ = np.polynomial.legendre.leggauss(16)
    cardinal = stencil(angle, 1.0)
    for function in (np.cos, np.sin, lambda x: x * np.cos(x), lambda x: x * np.sin(x), lambda x: x**3):
        assert np.abs(cardinal @ function(angle * nodes) - function(angle * 0.5 * node)).max() < 1e-10
    assert np.abs(cardinal).sum(axis=1).max() < 2.0


def _swing(count: int, step: float, seed: int = 3) -> np.ndarray:
    random = np.random.default_rng(seed)
    t = np.arange(count) * step
    return 0.01 * np.cos(N * t + 0.3) + 0.05 * np.cos(2 * np.pi * t / 8.0 + random.uniform(0, 6))


def _response(theta: np.ndarray, step: float, n: float, gamma: float, ratio: float, apart: float) -> np.ndarray:
    """What the identity takes off a difference without a swing of its own."""
    return -_sweep(np.zeros(theta.size), theta, step, (n, gamma, 0j, 0.0), ratio, apart)[0]


def _sweep(
    difference: np.ndarray,
    theta: np.ndarray,
    step: float,
    at: tuple[float, float, complex, float],
    ratio: float,
    apart: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Residual and Gram matrix at (n2, gamma2, start, offset)."""
    residual = np.empty(theta.size)
    gram = LinearIdentity(theta, difference, step, N, ratio, apart).sweep(*at, residual)
    return residual, gram


def one_sided(row: int, lam: complex, step: float) -> np.ndarray:
    """Weights of the eight nodes for the interval from node `row` to the next, by the functions' own integrals."""
    node, weight = np.polynomial.legendre.leggauss(20)
    x = 0.5 * (node + 1.0)
    kernel = 0.5 * step * weight * np.exp(lam * step * (1.0 - x))
    matrix = fitted_basis(np.arange(NODES) - CENTRE, N * step)
    return np.linalg.solve(matrix, fitted_basis(row - CENTRE + x, N * step) @ kernel)


@pytest.mark.parametrize("count", [8, 9, 255, 257, 600, 1601])
def test_response_is_the_running_integral(count: int) -> None:
    """Against one plain recursion without blocks, ages, tables or continued ends."""
    step, n, gamma, ratio, apart = 0.1, N * 1.00003, 2e-4, 1.001, 1e-4
    theta = _swing(count, step)
    lam, direct, gain, _, _ = response_constants(n, gamma, ratio, apart)
    weights = [one_sided(row, lam, step) for row in range(NODES - 1)]
    c, expected = 0j, [direct.real * theta[0]]
    for k in range(count - 1):
        row = k if k < 3 else (3 if k < count - 4 else k - count + 8)
        start = 0 if k < 3 else min(k - 3, count - 8)
        c = np.exp(lam * step) * c + weights[row] @ theta[start : start + 8]
        expected.append(direct.real * theta[k + 1] + (gain * c).imag)
    got = _response(theta, step, n, gamma, ratio, apart)
    assert np.abs(got - np.array(expected)).max() < 1e-13


@pytest.mark.parametrize("gamma", [0.0, 3e-4])
def test_response_solves_the_differential_equation(gamma: float) -> None:
    """`d'' + 2 g2 d' + n^2 d = (1-r) theta'' + 2 (g2 - r g1) theta'` for a harmonic, whose solution is elementary."""
    step, n, ratio, apart, m = 0.05, N, 1.001, 1e-4, 2 * np.pi / 9.0
    t = np.arange(1500) * step
    r = ratio**-2
    g1 = gamma + apart
    transfer = ((1 - r) * -(m**2) + 2 * (gamma - r * g1) * 1j * m) / (n**2 - m**2 + 2j * gamma * m)
    lam, direct, gain, _, _ = response_constants(n, gamma, ratio, apart)
    exact = (transfer * np.exp(1j * m * t)).real
    got = _response(np.cos(m * t), step, n, gamma, ratio, apart)
    # they differ by a free swing, whatever starts at rest in the running integral
    free = np.column_stack([(np.exp(lam * t)).real, (np.exp(lam * t)).imag])
    rest = got - exact
    rest -= free @ np.linalg.lstsq(free, rest, rcond=None)[0]
    assert np.abs(rest).max() < 1e-12
    assert np.abs(exact).max() > 1e-5
    assert complex(direct) == pytest.approx(1 - r)
    assert np.isfinite(gain)


@pytest.mark.parametrize("gamma", [0.0, 3e-4])
def test_products_are_those_of_the_derivatives(gamma: float) -> None:
    """The Gram matrix against central differences of the residual by all five parameters."""
    random, count, step, ratio, apart = np.random.default_rng(6), 1500, 0.1, 1.001, 1e-4
    theta, difference = _swing(count, step), 0.01 * random.normal(size=count)
    w = np.sqrt(N**2 - gamma**2)

    def sweep(change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        real, imag, turned, decayed, moved = change
        g = gamma + decayed
        at = (float(np.hypot(w + turned, g)), float(g), complex(0.012 + real, -0.004 + imag), 0.003 + moved)
        return _sweep(difference, theta, step, at, ratio, apart)

    residual, gram = sweep(np.zeros(5))
    sizes = np.array([1e-4, 1e-4, 1e-6, 1e-6, 1e-4])
    columns = [(sweep(-change)[0] - sweep(change)[0]) / (2 * change.sum()) for change in np.diag(sizes)]
    rows = np.stack([*columns, residual])
    exact = rows @ rows.T
    lower = np.tril_indices(6)
    # intervals are aged by half a step on average: (w h)^2/24 of the response's part alone
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.abs((gram - exact) / scale)[lower].max() < 1e-5
    assert gram[4, 4] == count


def test_response_changes_with_frequency_and_damping_as_told() -> None:
    """The same without a swing of its own, where the response is all that changes."""
    count, step, ratio, apart, d = 1500, 0.1, 1.05, 1e-3, 1e-6
    theta, gamma = _swing(count, step), 3e-4
    w = np.sqrt(N**2 - gamma**2)

    def at(turned: float, decayed: float) -> np.ndarray:
        g = gamma + decayed
        return _response(theta, step, float(np.hypot(w + turned, g)), g, ratio, apart)

    gram = _sweep(np.zeros(count), theta, step, (N, gamma, 0j, 0.0), ratio, apart)[1]
    for row, change in ((2, (d, 0.0)), (3, (0.0, d))):
        numeric = (at(*change) - at(-change[0], -change[1])) / (2 * d)
        assert np.sqrt(gram[row, row]) == pytest.approx(np.linalg.norm(numeric), rel=3e-3)
