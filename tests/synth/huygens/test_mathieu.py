"""Characteristic values against the matrix of Fourier coefficients, the monodromy table, and the paper's series."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from data_schemas.errors import UsageError
from synth.huygens.mathieu import exact, matters_from, series


def by_matrix(q: float) -> tuple[float, float]:
    """a1 and b1: least eigenvalues of the recurrences of odd cosines and sines."""
    squares = (2.0 * np.arange(30) + 1.0) ** 2
    found = []
    for sign in (1.0, -1.0):
        matrix = np.diag(squares) + np.diag(np.full(29, q), 1) + np.diag(np.full(29, q), -1)
        matrix[0, 0] += sign * q
        found.append(float(np.linalg.eigvalsh(matrix)[0]))
    return found[0], found[1]


@pytest.mark.parametrize("q", [0.0, 1e-3, 0.1, 1.0, 5.0, -0.3])
def test_exact_is_the_matrix(q: float) -> None:
    assert np.allclose(np.stack(exact(q)), by_matrix(q), rtol=0.0, atol=1e-12)


def test_published_values_at_5() -> None:
    """Abramowitz and Stegun, table 20.1: a1(5) = 1.85818754, b1(5) = -5.79008060."""
    assert float(exact(5.0).cosine) == pytest.approx(1.85818754, abs=5e-9)
    assert float(exact(5.0).sine) == pytest.approx(-5.79008060, abs=5e-9)


@pytest.mark.parametrize(("q", "trace"), [(0.1, -2.0246669154159), (1.0, -4.3966677347989), (5.0, -22.780286845154)])
def test_the_equation_is_the_sheets(q: float, trace: float) -> None:
    """Traces of the monodromy matrix at a = 1 (formula sheet 3.2), and -2 on both edges of the tongue."""

    def traced(a: float) -> float:
        def slope(z: float, y: np.ndarray) -> np.ndarray:
            return np.array([y[1], -(a - 2.0 * q * np.cos(2.0 * z)) * y[0]])

        ends = [solve_ivp(slope, (0.0, np.pi), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1] for start in np.eye(2)]
        return float(ends[0][0] + ends[1][1])

    assert traced(1.0) == pytest.approx(trace, rel=1e-10)
    for edge in exact(q):
        assert traced(float(edge)) == pytest.approx(-2.0, abs=1e-8)


@pytest.mark.parametrize("order", range(1, 6))
def test_the_series_errs_by_its_next_term(order: int) -> None:
    size = np.array([0.05, 0.1])
    wrong = np.abs(series(size, order).cosine - exact(size).cosine)
    assert np.log2(wrong[1] / wrong[0]) == pytest.approx(order + 1, abs=0.15)


def test_where_the_papers_series_matters() -> None:
    """q^2/8 is what 1 +- q neglects: against chi of one swing a day, from q = 0.0136 on; regimes have 0.003."""
    q = matters_from(2.3148e-5)
    assert q == pytest.approx(np.sqrt(8.0 * 2.3148e-5), rel=5e-3)
    assert matters_from(2.3148e-5, 2) > 0.1
    with pytest.raises(UsageError, match="give an error"):
        matters_from(0.0)
    with pytest.raises(UsageError, match="order = 9"):
        series(0.1, 9)
