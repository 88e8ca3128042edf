"""Taps of the projection against arbitrary-precision integrals, and its sweeps against plain sums."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from pipeline.projection import kernels
from pipeline.projection.solve import response_constants
from pipeline.projection.taps import CENTRE, NODES, fitted_basis, stencil, taps

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
def test_taps_are_exact_on_their_basis_at_every_interval(name: str, power: int, rate: float) -> None:
    step = 1.0 / rate
    lam = complex(-1e-4, np.sqrt(N**2 - 1e-8))
    z = np.arange(NODES) - CENTRE
    wave = {"one": np.ones_like, "cos": np.cos, "sin": np.sin}[name](N * step * z)
    weights = taps(stencil(N, step), lam, step)
    for row in (0, 3, 6):  # first one-sided, central, last one-sided
        exact = exact_integral(name, power, float(z[row]), step, lam)
        # one-sided weights are larger and so is their rounding
        assert abs(weights[row] @ (z**power * wave) - exact) < (2e-12 if row == 3 else 1e-10) * step


def test_taps_away_from_the_fitted_frequency_keep_the_order() -> None:
    """Swell and a detuned swing are not in the basis: eight points leave 2e-9 of swell of 10 s at 10 Hz."""
    step, lam = 0.1, 1j * N * 1.0001
    weights = taps(stencil(N, step), lam, step)[3]
    z = np.arange(NODES) - CENTRE
    for m, limit in ((2 * np.pi / 10.0, 3e-9), (2 * np.pi / 4.0, 1e-6), (N * 1.001, 1e-9)):
        exact = complex(
            mpmath.quad(lambda x, m=m: mpmath.exp(lam * (step - x)) * mpmath.cos(m * (x - 0.05)), [0, step])
        )
        assert abs(weights @ np.cos(m * step * z) - exact) < limit * step


@pytest.mark.parametrize("angle", [0.01, 0.2, 0.57, 0.58, 1.2])
def test_both_forms_of_the_basis_span_the_same_functions(angle: float) -> None:
    """0.571 rad is where series give way to plain functions: interpolation must not notice."""
    nodes = np.arange(NODES) - CENTRE
    at = np.array([-3.2, -0.1, 0.0, 0.4, 2.9])
    matrix = fitted_basis(nodes, angle)
    for function in (np.cos, np.sin, lambda x: x * np.cos(x), lambda x: x * np.sin(x), lambda x: x**3):
        values = function(angle * nodes)
        got = np.linalg.solve(matrix.T, values) @ fitted_basis(at, angle)
        # for plain functions at a small angle the system is ill-conditioned; the series form must stay exact
        assert np.abs(got - function(angle * at)).max() < 1e-10


def _swing(count: int, step: float, seed: int = 3) -> np.ndarray:
    random = np.random.default_rng(seed)
    t = np.arange(count) * step
    return 0.01 * np.cos(N * t + 0.3) + 0.05 * np.cos(2 * np.pi * t / 8.0 + random.uniform(0, 6))


def _response(theta: np.ndarray, step: float, n: float, gamma: float, ratio: float, apart: float) -> list[np.ndarray]:
    lam, direct, gain, by_frequency, by_damping = response_constants(n, gamma, ratio, apart)
    weights = taps(stencil(N, step), lam, step)
    integral = np.empty((2, theta.size - 1))
    kernels.interval_integrals(theta, weights.real.copy(), weights.imag.copy(), *integral)
    out = [np.empty(theta.size) for _ in range(3)]
    kernels.forced_response(
        theta, *integral, step, gamma, lam.imag, direct.real, complex(gain), complex(by_frequency),
        complex(by_damping), *out,
    )  # fmt: skip
    return out


def test_interval_integrals_are_the_taps_on_each_stencil() -> None:
    theta = np.random.default_rng(2).normal(size=40)
    weights = taps(stencil(N, 0.1), complex(-1e-3, N), 0.1)
    out = np.empty((2, 39))
    kernels.interval_integrals(theta, weights.real.copy(), weights.imag.copy(), *out)
    for k in range(39):
        row = k if k < 3 else (3 if k < 36 else k - 32)
        start = 0 if k < 3 else (k - 3 if k < 36 else 32)
        assert complex(out[0, k], out[1, k]) == pytest.approx(
            complex(weights[row] @ theta[start : start + 8]), abs=1e-14
        )


@pytest.mark.parametrize("count", [8, 9, 255, 257, 600])
def test_response_is_the_running_integral(count: int) -> None:
    """Against one plain recursion without blocks, ages or tables."""
    step, n, gamma, ratio, apart = 0.1, N * 1.00003, 2e-4, 1.001, 1e-4
    theta = _swing(count, step)
    lam, direct, gain, _, _ = response_constants(n, gamma, ratio, apart)
    weights = taps(stencil(N, step), lam, step)
    c, expected = 0j, [direct.real * theta[0]]
    for k in range(count - 1):
        row = k if k < 3 else (3 if k < count - 4 else k - count + 8)
        start = 0 if k < 3 else min(k - 3, count - 8)
        c = np.exp(lam * step) * c + weights[row] @ theta[start : start + 8]
        expected.append(direct.real * theta[k + 1] + (gain * c).imag)
    got = _response(theta, step, n, gamma, ratio, apart)[0]
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
    got = _response(np.cos(m * t), step, n, gamma, ratio, apart)[0]
    # they differ by a free swing, whatever starts at rest in the running integral
    free = np.column_stack([(np.exp(lam * t)).real, (np.exp(lam * t)).imag])
    rest = got - exact
    rest -= free @ np.linalg.lstsq(free, rest, rcond=None)[0]
    assert np.abs(rest).max() < 1e-12
    assert np.abs(exact).max() > 1e-5
    assert complex(direct) == pytest.approx(1 - r)
    assert np.isfinite(gain)


def test_slopes_are_derivatives_of_the_response() -> None:
    step, gamma, ratio, apart, d = 0.05, 2e-4, 1.001, 1e-4, 1e-5
    theta = _swing(1500, step)
    lam = response_constants(N, gamma, ratio, apart)[0]
    w = lam.imag

    def at(dw: float, dgamma: float) -> np.ndarray:
        g = gamma + dgamma
        return _response(theta, step, float(np.hypot(w + dw, g)), g, ratio, apart)[0]

    got = _response(theta, step, N, gamma, ratio, apart)
    numeric = (at(d, 0.0) - at(-d, 0.0)) / (2 * d)
    # intervals are aged by half a step on average: (w h)^2/24 of the youngest one only
    assert np.abs(got[1] - numeric).max() < 3e-3 * np.abs(numeric).max()
    numeric = (at(0.0, d) - at(0.0, -d)) / (2 * d)
    assert np.abs(got[2] - numeric).max() < 3e-3 * np.abs(numeric).max()


@pytest.mark.parametrize("count", [100, 256, 700])
@pytest.mark.parametrize("limit", [np.inf, 0.8])
def test_moments_are_the_plain_gram_matrix(count: int, limit: float) -> None:
    random = np.random.default_rng(6)
    difference, response, slope, by_damping = random.normal(size=(4, count))
    difference[10:14] = np.nan
    step, decay, frequency = 0.1, 3e-3, N
    coefficient = np.array([0.1, -0.2, 0.05])
    gram = np.empty((kernels.COLUMNS, kernels.COLUMNS))
    beyond = kernels.moments(difference, response, slope, by_damping, step, decay, frequency, coefficient, limit, gram)
    t = np.arange(count) * step
    wave = np.exp((-decay + 1j * frequency) * t)
    x = np.linspace(-1.0, 1.0, count)
    e = difference - response - coefficient[0] * wave.real - coefficient[1] * wave.imag - coefficient[2]
    columns = np.stack(
        [wave.real, wave.imag, np.ones(count), x * wave.real, x * wave.imag, slope, by_damping, e], axis=1
    )
    used = np.abs(e) <= limit
    plain = columns[used].T @ columns[used]
    assert np.abs(np.triu(gram) - np.triu(plain)).max() < 1e-11 * count
    assert beyond == int((np.abs(e) > limit).sum())
    out = np.empty(count)
    kernels.residuals(difference, response, step, decay, frequency, coefficient, limit, out)
    assert (np.isfinite(out) == used).all()
    assert np.abs(out[used] - e[used]).max() < 1e-12
