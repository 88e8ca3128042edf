"""Harmonic balance: every solution of the six equations (7)-(8), found by elimination and counted by Sturm's theorem.

With w_i = q e^{2i alpha_i}, G_i = A_i^2/4 and g_i = 1 - G_i, (7) says w_i = E_i - i delta g_i, E_i the detuning
felt. Put into (8),

    E_i^2 + delta^2 g_i^2 = s,       s = q^2 = (nu d/(2 d0)) sum g_i (1 - g_i),       beta s = (nu/2) sum (1 - g_i) E_i:

three conics in g_1, g_2 whose coefficients are polynomials of beta. They meet only where their resultant vanishes, a
polynomial of degree 20 of beta (4 times the coefficients' 2, 2 and 1), and since 0 <= s <= nu d/(4 d0),
|E_i| <= sqrt(s) shuts beta into an interval. Doubles are rationals: all its roots there are isolated in exact
arithmetic, and in each all intersections are tried, so that none is missed and none doubled.

Three quadratic forms in three unknowns vanish together somewhere (but at the origin) if and only if the determinant of
six quadratic forms does: the three, and the slopes of their Jacobian, which also vanish wherever the three do
(G. Salmon, Lessons introductory to the modern higher algebra, 1885, art. 90).

Symmetries are divided out: alpha_i counts modulo pi (y_i -> -y_i, of each alone), and q >= 0 fixes where z begins. A
clock that stands still (A_i = 0) solves the equations of motion but not (7), and is not among them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import Ordering, ctx, fmpq, fmpq_mpoly_ctx, fmpz_poly

from synth.huygens.clocks import Clocks, checked, jacobian
from synth.phase import Floats

_WIDTH = Fraction(1, 1 << 70)  # of a root's bracket
_LARGEST_SHARE = Fraction(12072, 10000)  # of A^2/4: (g, g) lies within a circle about (1/2, 1/2)
_ALIKE = 1e-9  # solutions nearer than this share of their size are one
_SETTLED, _ROUNDED = 1e-13, 1e-7  # of a step: small enough; small enough if it no longer shrinks
_LEAST = 1e-300

Conic = tuple[Any, Any, Any, Any, Any, Any]
"""Coefficients of x^2, x y, y^2, x, y, 1: fractions, or polynomials with rational coefficients."""

_TERMS = ((2, 0, 0), (1, 1, 0), (0, 2, 0), (1, 0, 1), (0, 1, 1), (0, 0, 2))
"""Powers of x, y, z in the same order, z making the forms homogeneous."""


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

    Examples
    --------
    >>> for regime in solutions(Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114))):
    ...     print(round(regime.beta, 4), round(regime.q, 5), round(regime.offset, 3))
    0.0115 0.0 1.571
    0.0127 0.00218 0.0
    """
    equations = _Equations(checked(clocks), shifts)
    low, high = equations.interval()
    roots = real_roots(resultant(equations.conics), low, high, _WIDTH) if low < high else []
    candidates = [equations.regime(point) for root in roots for point in equations.intersections(float(root))]
    if clocks.detuning[0] == clocks.detuning[1]:
        candidates.append(equations.quadrature())
    regimes: list[Regime] = []
    for each in candidates:
        if each is not None and not any(_same(each, other) for other in regimes):
            regimes.append(each)
    return sorted(regimes, key=lambda each: (each.beta, each.q, each.offset))


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
    """The regime of other clocks that lies next to a known one, by Newton's method; None if there is none.

    For continuation in small steps, hundreds of times faster than `solutions`; q must not be 0.
    """
    shares = [1.0 - 0.25 * size * size for size in regime.amplitude]
    return _Equations(checked(clocks), shifts).regime(np.array([regime.beta, *shares]))


def _same(one: Regime, other: Regime) -> bool:
    near = math.isclose(one.beta, other.beta, rel_tol=0.0, abs_tol=_ALIKE * max(one.q, other.q, 1e-6))
    turned = max(abs(_folded(one.alpha[i] - other.alpha[i])) for i in (0, 1))
    return near and turned < 1e3 * _ALIKE and abs(one.amplitude[0] - other.amplitude[0]) < 1e3 * _ALIKE


def _folded(angle: float) -> float:
    turned = math.remainder(angle, math.pi)
    return turned if turned > -0.5 * math.pi else 0.5 * math.pi


def _rational(value: Fraction) -> Any:
    """A fraction as a number that goes with polynomials."""
    return fmpq(value.numerator, value.denominator)


class _Equations:
    """The three conics of one pair of clocks."""

    def __init__(self, clocks: Clocks, shifts: bool) -> None:
        self._clocks, self._shifts = clocks, shifts
        self._drive, self._coupling = Fraction(clocks.drive), Fraction(clocks.coupling)
        self._arc = Fraction(clocks.swing) ** 2 / 2 if shifts else Fraction(0)
        less = self._drive**2 / 8 if shifts else Fraction(0)
        self._tuning = [1 + Fraction(tau) - less for tau in clocks.detuning]
        self._feed = self._coupling * self._drive / (2 * Fraction(clocks.beam_damping))  # s = feed sum g (1 - g)

    def interval(self) -> tuple[Fraction, Fraction]:
        """Where beta can be: |(1 + beta)(1 + tau_i) - 1 - arc G_i| <= sqrt(s), with s <= feed/2 and 0 <= G_i."""
        reach = Fraction(math.sqrt(float(self._feed) / 2.0) * (1.0 + 1e-12))
        low = max((1 - reach) / tuning - 1 for tuning in self._tuning)
        high = min((1 + reach + self._arc * _LARGEST_SHARE) / tuning - 1 for tuning in self._tuning)
        return max(low, Fraction(-1)), high

    def conics(self, beta: Any, number: Callable[[Fraction], Any] = _rational) -> list[Conic]:
        """The first two equations less s, and beta s - (nu/2) sum (1 - g_i) E_i; E_i = D_i + arc g_i."""
        feed, arc, half, none = (number(each) for each in (self._feed, self._arc, self._coupling / 2, Fraction(0)))
        one, two = ((1 + beta) * number(tuning) - 1 - arc for tuning in self._tuning)
        square = arc**2 + number(self._drive) ** 2 * (1 + beta)
        even, first, second = half * arc - beta * feed, half * (arc - one), half * (arc - two)
        return [
            (square + feed, none, feed, 2 * arc * one - feed, -feed, one**2),
            (feed, none, square + feed, -feed, 2 * arc * two - feed, two**2),
            (even, none, even, beta * feed - first, beta * feed - second, -half * (one + two)),
        ]

    def _values(self, point: Any) -> Any:
        """The three conics, each divided by its own size, at (beta, g_1, g_2)."""
        beta, one, two = point
        sizes = np.array([float(self._feed), float(self._feed), 0.5 * self._clocks.coupling])
        return np.array(self.conics(beta, float)) @ np.array([one * one, one * two, two * two, one, two, 1.0]) / sizes

    def _detunings(self, beta: Any) -> tuple[Any, Any, float, Any]:
        """D_1, D_2, arc and delta^2."""
        arc = float(self._arc)
        one, two = ((1.0 + beta) * float(tuning) - 1.0 - arc for tuning in self._tuning)
        return one, two, arc, self._clocks.drive**2 * (1.0 + beta)

    def intersections(self, beta: float) -> Iterator[Floats]:
        """Real points (beta, g_1, g_2) on the first two conics, nearly: candidates.

        With v_i = g_i + arc D_i/a, a = arc^2 + delta^2, their difference is v_1^2 - v_2^2 = K; with p = v_1 + v_2 and
        m = v_1 - v_2 that is p m = K, and their sum a quartic in p (or in m).
        """
        d1, d2, arc, loss = self._detunings(beta)
        a, feed = arc * arc + loss, float(self._feed)
        t1, t2 = arc * d1 / a, arc * d2 / a
        k = (d2 * d2 - d1 * d1) * loss / (a * a)
        # a (v1^2 + v2^2)/2 + loss (d1^2 + d2^2)/(2 a) = feed sum [(1 + 2 t_i) v_i - v_i^2 - t_i - t_i^2]
        square = 0.25 * (a + 2.0 * feed)  # of p^2 + m^2
        plus, minus = -0.5 * feed * (2.0 + 2.0 * t1 + 2.0 * t2), -feed * (t1 - t2)  # of p, of m
        rest = loss * (d1 * d1 + d2 * d2) / (2.0 * a) + feed * (t1 + t1 * t1 + t2 + t2 * t2)
        for own, other, swapped in ((plus, minus, False), (minus, plus, True)):
            for root in np.roots([square, own, rest, other * k, square * k * k]):
                # two that meet part into a pair of complex ones by rounding alone: Newton tells
                p = float(root.real) if abs(root) > _LEAST else 0.0
                for m in [k / p] if p != 0.0 else [0.0]:
                    one, two = (m, p) if swapped else (p, m)
                    yield np.array([beta, 0.5 * (one + two) - t1, 0.5 * (one - two) - t2])

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
        d1, d2, arc, loss = self._detunings(beta)
        delta = math.sqrt(loss)
        phasors = [complex(own + arc * each, -delta * each) for own, each in zip((d1, d2), g, strict=True)]
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


def real_roots(values: Sequence[Fraction], low: Fraction, high: Fraction, width: Fraction) -> list[Fraction]:
    """Different real roots in [low, high], increasing, of a polynomial with these coefficients, lowest power first.

    Each is the middle of an interval no wider than `width` that holds it and no other; a root nearer to an end than
    half of that may be given too. `ValueError` if the polynomial is zero everywhere.

    Examples
    --------
    (x^2 - 2)(x - 1)^2: the double root is one.

    >>> roots = real_roots([Fraction(c) for c in (-2, 4, -1, -2, 1)], Fraction(0), Fraction(2), Fraction(1, 10**9))
    >>> [round(float(root), 6) for root in roots]
    [1.0, 1.414214]
    """
    scale = math.lcm(*(each.denominator for each in values))
    polynomial: Any = fmpz_poly([int(each * scale) for each in values])
    if polynomial == 0:
        raise ValueError("the polynomial is zero everywhere")
    digits = ctx.prec
    try:
        while True:
            real = [root.real for root, _ in polynomial.complex_roots() if root.imag == 0]
            balls = [(_fraction(each.mid()), _fraction(each.rad())) for each in real]
            inside = [each for each in balls if low <= sum(each) and each[0] - each[1] <= high]
            if all(2 * radius <= width for _, radius in inside):
                return sorted(middle for middle, _ in inside)
            ctx.prec *= 2
    finally:
        ctx.prec = digits


def _fraction(number: Any) -> Fraction:
    mantissa, exponent = number.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def resultant(conics: Callable[[Any], Sequence[Conic]]) -> list[Fraction]:
    """Coefficients, lowest power first, of the polynomial of one unknown that is zero if and only if three conics have
    a point in common, real or not, finite or not; `conics` gives the three from the unknown.
    """
    ring = fmpq_mpoly_ctx.get(["x", "y", "z", "unknown"], Ordering.lex)
    terms = [ring.from_dict({(*term, 0): 1}) for term in _TERMS]
    forms = []
    for conic in conics(ring.gens()[3]):
        numbers = [_rational(each) if isinstance(each, Fraction) else each for each in conic]
        forms.append(sum(term * each for term, each in zip(terms, numbers, strict=True)))
    jacobian = _determinant([[form.derivative(axis) for axis in range(3)] for form in forms])
    forms += [jacobian.derivative(axis) for axis in range(3)]
    rows = [
        [ring.from_dict({key: value for key, value in form.to_dict().items() if key[:3] == term}) for term in _TERMS]
        for form in forms
    ]
    # every product of the expansion holds each term once: together x^4 y^4 z^4
    by_power = {key[3]: Fraction(int(value.p), int(value.q)) for key, value in _determinant(rows).to_dict().items()}
    return [by_power.get(power, Fraction(0)) for power in range(max(by_power, default=0) + 1)]


def _determinant(rows: list[list[Any]]) -> Any:
    """By expansion: 6 x 6 at most."""
    if not rows:
        return 1
    minors = ([row[:k] + row[k + 1 :] for row in rows[1:]] for k in range(len(rows)))
    return sum(
        (-1) ** k * value * _determinant(minor) for k, (value, minor) in enumerate(zip(rows[0], minors, strict=True))
    )
