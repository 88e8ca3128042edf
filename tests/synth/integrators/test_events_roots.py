"""The first crossing of a polynomial is found, a touch is none, whatever lies close together."""

from __future__ import annotations

import numpy as np
import pytest

from synth.integrators.events import DEGREE, NONE, TO_BERNSTEIN, first_crossing, margin
from synth.phase import Floats


def bernstein(polynomial: np.polynomial.Polynomial) -> Floats:
    """Bernstein coefficients from values: the interpolation problem, solved."""
    from math import comb

    shares = np.linspace(0.0, 1.0, DEGREE + 1)
    matrix = np.array([[comb(DEGREE, j) * x**j * (1 - x) ** (DEGREE - j) for j in range(DEGREE + 1)] for x in shares])
    return np.linalg.solve(matrix, polynomial(shares))


def first(coefficients: Floats, direction: int = 0, before: int = 0) -> float:
    rows = np.zeros((60, DEGREE + 1))
    rows[0] = coefficients
    return float(first_crossing(rows, np.zeros((60, 2)), before, direction))


@pytest.mark.parametrize("seed", range(60))
def test_first_root_against_companion_matrix(seed: int) -> None:
    rng = np.random.default_rng(seed)
    polynomial = np.polynomial.Polynomial.fromroots(rng.uniform(-0.5, 1.5, DEGREE)) * 100.0
    roots = np.sort(np.real(polynomial.roots()))
    inside = roots[(roots > 0.0) & (roots < 1.0)]
    slopes = polynomial.deriv()(inside)
    for direction in (0, 1, -1):
        wanted = inside[(direction == 0) | (np.sign(slopes) == direction)]
        expected = wanted[0] if wanted.size else NONE
        assert first(bernstein(polynomial), direction) == pytest.approx(expected, abs=1e-9)  # condition of the roots


def test_two_crossings_within_a_step_are_two_and_a_touch_is_none() -> None:
    base = np.polynomial.Polynomial([0.25, -1.0, 1.0])  # (x - 1/2)^2
    assert first(bernstein(base - 1e-10), -1) == pytest.approx(0.5 - 1e-5, abs=1e-9)
    assert first(bernstein(base - 1e-10), +1) == pytest.approx(0.5 + 1e-5, abs=1e-9)
    assert first(bernstein(base + 1e-10)) == NONE
    assert first(np.abs(bernstein(base)), +1) == NONE


def test_a_start_on_the_level_is_a_crossing_only_from_the_other_side() -> None:
    rising = bernstein(np.polynomial.Polynomial([0.0, 1.0]))
    rising[0] = 0.0
    assert first(rising, 1, before=1) == NONE
    assert first(rising, 1, before=0) == NONE
    assert first(rising, 1, before=-1) == 0.0


def test_a_second_crossing_soon_after_a_start_on_the_level() -> None:
    """Up through the level at 0 and down again at 1e-3: the one at 0 has been, the other is found."""
    hump = bernstein(np.polynomial.Polynomial([0.0, 1e-3, -1.0]))
    hump[0] = 0.0
    assert first(hump, 0, before=1) == pytest.approx(1e-3, rel=1e-9)
    assert first(hump, 1, before=1) == NONE


def test_an_end_on_the_level_is_left_to_the_next_step() -> None:
    arriving = bernstein(np.polynomial.Polynomial([-1.0, 1.0]))
    arriving[-1] = 0.0
    assert first(arriving, 1) == NONE


def test_triple_root_is_one_crossing() -> None:
    cubic = np.polynomial.Polynomial([-0.3, 1.0]) ** 3
    assert first(bernstein(cubic), 1) == pytest.approx(0.3, abs=1e-4)  # cube root of rounding
    assert first(bernstein(cubic), -1) in (NONE, pytest.approx(0.3, abs=1e-4))


def test_table_turns_the_dense_output_into_bernstein_form() -> None:
    from math import comb

    rng = np.random.default_rng(0)
    f, x = rng.normal(size=7), 0.37
    direct = x * (f[0] + (1 - x) * (f[1] + x * (f[2] + (1 - x) * (f[3] + x * (f[4] + (1 - x) * (f[5] + x * f[6]))))))
    basis = np.array([comb(DEGREE, j) * x**j * (1 - x) ** (DEGREE - j) for j in range(DEGREE + 1)])
    assert basis @ (f @ TO_BERNSTEIN) == pytest.approx(direct, rel=1e-13)


def test_margin_is_the_value_at_the_turn() -> None:
    rows = np.zeros((60, DEGREE + 1))
    rows[0] = bernstein(np.polynomial.Polynomial([0.16 - 1e-6, -0.8, 1.0]))  # turns at 0.4, where it is -1e-6
    assert margin(rows) == pytest.approx(1e-6, rel=1e-8)
    rows[0] = bernstein(np.polynomial.Polynomial([1.0, 1.0]))
    assert margin(rows) == np.inf
