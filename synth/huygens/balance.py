"""Harmonic balance: every solution of the six equations (7)-(8), found by exact elimination.

With w_i = q e^{2i alpha_i}, G_i = A_i^2/4 and g_i = 1 - G_i, (7) says w_i = E_i - i delta g_i, E_i the detuning
felt. Put into (8),

    E_i^2 + delta^2 g_i^2 = s,       s = q^2 = (nu d/(2 d0)) sum g_i (1 - g_i),       beta s = (nu/2) sum (1 - g_i) E_i:

three conics in g_1, g_2 without a product of the two, whose coefficients are polynomials of beta. Without the squares
a line is left of them; where it meets the first two conics in one point, a polynomial of degree 20 of beta vanishes.
Doubles are rationals: the polynomial is exact, its real roots are isolated, and in each all intersections are tried.

alpha_i counts modulo pi, and q >= 0 fixes where z begins. A clock that stands still (A_i = 0) is no solution of (7).
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import fmpq, fmpq_poly

from synth.huygens.clocks import Clocks, checked, jacobian
from synth.phase import Floats

_ALIKE = 1e-9  # solutions nearer than this share of their size are one
_SETTLED, _ROUNDED = 1e-13, 1e-7  # of a step: small enough; small enough if it no longer shrinks

Conic = tuple[Any, Any, Any, Any, Any]
"""Coefficients of x^2, y^2, x, y, 1: numbers, or polynomials with rational coefficients."""


class Regime(NamedTuple):
    """One synchronous regime, y_i = A_i cos(z - alpha_i), x = -X cos 2z, z = w t/2."""

    beta: float  # w0^2/w^2 - 1, w the beam's frequency
    q: float  # 2X/l, not below 0
    alpha: tuple[float, float]  # rad, in (-pi/2, pi/2]
    amplitude: tuple[float, float]  # A_i, about 2

    @property
    def offset(self) -> float:
        """eta = alpha_1 - alpha_2 modulo pi, in (-pi/2, pi/2]: 0 in the paper's regime, +-pi/2 in quadrature."""
        return _folded(self.alpha[0] - self.alpha[1])


def solutions(clocks: Clocks, *, shifts: bool = False) -> list[Regime]:
    """Return all synchronous regimes of the harmonic balance, by rising beta.

    With `shifts` the detuning felt loses van der Pol's delta^2/8 and the arc's Phi0^2 A_i^2/8, which the paper omits:
    the solutions are then the fixed points of the slow flow. Without, the equations are those printed, (7)-(8).
    `UsageError` for parameters that cannot be meant.

    >>> for regime in solutions(Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114))):
    ...     print(round(regime.beta, 4), round(regime.q, 5), round(regime.offset, 3))
    0.0115 0.0 1.571
    0.0127 0.00218 0.0
    """
    equations = _Equations(checked(clocks), shifts)
    candidates = [equations.regime(point) for root in equations.roots() for point in equations.intersections(root)]
    if clocks.detuning[0] == clocks.detuning[1]:
        candidates.append(equations.quadrature())
    regimes: list[Regime] = []
    for each in candidates:
        if each is not None and not any(_same(each, other) for other in regimes):
            regimes.append(each)
    return sorted(regimes, key=lambda each: (round(each.beta, 12), each.q, each.offset))


def residuals(regime: Regime, clocks: Clocks, *, shifts: bool = False) -> Floats:
    """What is left of the six equations (7), (7), (8): (6,), as printed with A_i in (8)."""
    stretch = math.sqrt(1.0 + regime.beta)
    delta, delta0 = clocks.drive * stretch, clocks.beam_damping * stretch
    less, arc = (0.125 * delta * delta, 0.5 * clocks.swing**2) if shifts else (0.0, 0.0)
    angle, square = np.array(regime.alpha), np.array(regime.amplitude) ** 2
    share, feed = 0.25 * square, clocks.coupling / 8.0
    own = (1.0 + regime.beta) * (1.0 + np.array(clocks.detuning)) - 1.0 - less - arc * share
    loss = delta * (1.0 - share)
    real = (own - regime.q) * np.cos(angle) - loss * np.sin(angle)
    imaginary = (own + regime.q) * np.sin(angle) + loss * np.cos(angle)
    swing = feed * np.sum(square * np.exp(2j * angle)) + (delta0 * 1j - regime.beta) * regime.q
    return np.array([*np.stack([real, imaginary], axis=1).ravel(), swing.real, swing.imag])


def followed(regime: Regime, clocks: Clocks, *, shifts: bool = False) -> Regime | None:
    """The regime of other clocks next to a known one with q not 0, by Newton's method in small steps; None if none."""
    shares = [1.0 - 0.25 * size * size for size in regime.amplitude]
    return _Equations(checked(clocks), shifts).regime(np.array([regime.beta, *shares]))


def _same(one: Regime, other: Regime) -> bool:
    near = math.isclose(one.beta, other.beta, rel_tol=0.0, abs_tol=_ALIKE * max(one.q, other.q, 1e-6))
    turned = max(abs(_folded(one.alpha[i] - other.alpha[i])) for i in (0, 1))
    return near and turned < 1e3 * _ALIKE and abs(one.amplitude[0] - other.amplitude[0]) < 1e3 * _ALIKE


def _folded(angle: float) -> float:
    turned = math.remainder(angle, math.pi)
    return turned if turned > -0.5 * math.pi else 0.5 * math.pi


class _Equations:
    """The three conics of one pair of clocks."""

    def __init__(self, clocks: Clocks, shifts: bool) -> None:
        self._clocks, self._shifts = clocks, shifts
        self._drive, self._coupling = Fraction(clocks.drive), Fraction(clocks.coupling)
        self._arc = Fraction(clocks.swing) ** 2 / 2 if shifts else Fraction(0)
        less = self._drive**2 / 8 if shifts else Fraction(0)
        self._tuning = [1 + Fraction(tau) - less for tau in clocks.detuning]
        self._feed = self._coupling * self._drive / (2 * Fraction(clocks.beam_damping))  # s = feed sum g (1 - g)

    def conics(self, beta: Any, number: Callable[[Any], Any] = lambda x: fmpq(*x.as_integer_ratio())) -> list[Conic]:
        """The first two equations less s, and beta s - (nu/2) sum (1 - g_i) E_i; E_i = D_i + arc g_i."""
        feed, arc, half = (number(each) for each in (self._feed, self._arc, self._coupling / 2))
        one, two = ((1 + beta) * number(tuning) - 1 - arc for tuning in self._tuning)
        square = arc**2 + number(self._drive) ** 2 * (1 + beta)
        even, first, second = half * arc - beta * feed, half * (arc - one), half * (arc - two)
        return [
            (square + feed, feed, 2 * arc * one - feed, -feed, one**2),
            (feed, square + feed, -feed, 2 * arc * two - feed, two**2),
            (even, even, beta * feed - first, beta * feed - second, -half * (one + two)),
        ]

    def _values(self, point: Any) -> Any:
        """The three conics, each divided by its own size, at (beta, g_1, g_2)."""
        beta, one, two = point
        sizes = np.array([float(self._feed), float(self._feed), 0.5 * self._clocks.coupling])
        return np.array(self.conics(beta, float)) @ np.array([one * one, two * two, one, two, 1.0]) / sizes

    def roots(self) -> list[float]:
        """All beta at which the three conics have a point in common, real or not."""
        roots = resultant(self.conics(fmpq_poly([0, 1]))).complex_roots()
        return [float(root.real) for root, _ in roots if root.imag == 0 and root.real > -1]

    def intersections(self, beta: float) -> list[Floats]:
        """Points (beta, g_1, g_2) on the first two conics, nearly; two that meet may part by rounding.

        x times 1, x, y and x y is linear in these four on both conics: their values at the points are eigenvectors.
        """
        conics: Floats = np.array(self.conics(beta, float)[:2])
        (b1, c1, a1), (b2, c2, a2) = -np.linalg.solve(conics[:, :2], conics[:, 2:])
        times_x = [[0.0, 1.0, 0.0, 0.0], [a1, b1, c1, 0.0], [0.0, 0.0, 0.0, 1.0], [c1 * a2, c1 * b2, a1 + c1 * c2, b1]]
        ones, *points = np.linalg.eig(times_x)[1]
        with np.errstate(all="ignore"):
            return [np.array([beta, x.real, y.real]) for x, y in zip(points[0] / ones, points[1] / ones, strict=True)]

    def _polished(self, place: Floats) -> Floats | None:
        """Newton from a candidate; None where it leads nowhere."""
        before = math.inf
        with np.errstate(all="ignore"):
            for _ in range(40):
                matrix = jacobian(self._values, place)
                if not np.isfinite(matrix).all():
                    return None
                size = np.abs(matrix).max(axis=0)
                size = np.where(size > 0.0, size, 1.0)
                step = np.linalg.lstsq(matrix / size, self._values(place), rcond=None)[0] / size
                place = place - step
                reach = float(np.abs(step / (1e-3 + np.abs(place))).max())
                # near a fold rounding alone moves the point: a step that no longer shrinks is one
                if reach <= _SETTLED or (reach <= _ROUNDED and reach > 0.5 * before):
                    return place
                before = reach
        return None

    def regime(self, candidate: Floats) -> Regime | None:
        """The regime at a solution next to a candidate, if there is one whose angles are real and q not 0."""
        point = self._polished(candidate)
        if point is None:
            return None
        beta, *g = (float(each) for each in point)
        if not (beta > -1.0 and max(g) < 1.0):
            return None
        arc, delta = float(self._arc), math.sqrt(self._clocks.drive**2 * (1.0 + beta))
        detunings = ((1.0 + beta) * float(tuning) - 1.0 - arc for tuning in self._tuning)  # D_i
        phasors = [complex(own + arc * each, -delta * each) for own, each in zip(detunings, g, strict=True)]
        q = math.sqrt(0.5 * (abs(phasors[0]) ** 2 + abs(phasors[1]) ** 2))
        if q < 1e-9 * math.sqrt(float(self._feed)):
            return None  # the beam at rest: `quadrature`
        angles = [_folded(0.5 * math.atan2(each.imag, each.real)) for each in phasors]
        regime = Regime(beta, q, (angles[0], angles[1]), (2.0 * math.sqrt(1.0 - g[0]), 2.0 * math.sqrt(1.0 - g[1])))
        left = np.abs(residuals(regime, self._clocks, shifts=self._shifts)).max()
        return regime if left < 1e-9 * max(q, self._clocks.coupling) else None

    def quadrature(self) -> Regime:
        """The beam at rest, clocks alike a quarter of a swing apart, each as if it were alone: A = 2, E = 0."""
        beta = float((1 + self._arc) / self._tuning[0] - 1)
        return Regime(beta, 0.0, (0.25 * math.pi, -0.25 * math.pi), (2.0, 2.0))


def resultant(conics: list[Conic]) -> Any:
    """The polynomial that is zero where three conics, whose coefficients are polynomials, have a point in common.

    The line in which the squares cancel, put into the first two, leaves two quadratics of x: it is their resultant,
    less the factors of lines along y or of none.
    """

    def minor(m: int) -> Any:
        (a1, b1, *one), (a2, b2, *two), (a3, b3, *three) = conics
        return (a1 * b2 - a2 * b1) * three[m] - (a1 * b3 - a3 * b1) * two[m] + (a2 * b3 - a3 * b2) * one[m]

    x, y, rest = minor(0), minor(1), minor(2)
    (a1, b1, c1), (a2, b2, c2) = (
        (
            xx * y**2 + yy * x**2,
            2 * yy * x * rest + (own * y - other * x) * y,
            (yy * rest - other * y) * rest + one * y**2,
        )
        for xx, yy, own, other, one in conics[:2]
    )
    squares = conics[0][0] * conics[1][1] - conics[1][0] * conics[0][1]
    return ((a1 * c2 - a2 * c1) ** 2 - (a1 * b2 - a2 * b1) * (b1 * c2 - b2 * c1)) // (y * y * squares) ** 2
