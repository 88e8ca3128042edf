"""The near-integrable splitting: its orders, and agreement with a method that shares nothing with it."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from synth.integrators import explicit, splitting
from synth.integrators.splitting_schemes import SCHEMES, Scheme
from synth.motion.harmonic_sum import HarmonicSum
from synth.propagators.even import EvenTimes
from synth.propagators.picard import PicardPlan
from synth.systems.dispatch import energy
from synth.systems.driven_pendulums import DrivenPendulums, plain
from synth.systems.harmonic_motion import harmonics, opposite
from synth.systems.resistance import Quadratic, Viscous
from synth.systems.restoring import Linear, Sine

EACH = pytest.mark.parametrize("scheme", SCHEMES.values(), ids=list(SCHEMES))


@EACH
def test_first_order_is_a_quadrature(scheme: Scheme) -> None:
    """The error's part linear in eps is that of the quadrature: exact to the power below the first order."""
    for power in range(scheme.orders[0]):
        assert (scheme.weights * scheme.nodes**power).sum() == pytest.approx(1 / (power + 1), abs=3e-16)
    beyond = scheme.orders[0]
    assert abs((scheme.weights * scheme.nodes**beyond).sum() - 1 / (beyond + 1)) > 1e-9


@EACH
def test_second_order_conditions(scheme: Scheme) -> None:
    """Linear in eps^2: the double integral over s1 < s2 of s1^p s2^q, for p + q < 4 with the symmetric order 6."""
    powers = scheme.orders[1] - 2
    for p in range(powers):
        for q in range(powers - p):
            total = 0.0
            for j, (node, weight) in enumerate(zip(scheme.nodes, scheme.weights, strict=True)):
                before = (scheme.weights[:j] * scheme.nodes[:j] ** p).sum() + 0.5 * weight * node**p
                total += weight * node**q * before
            assert total == pytest.approx(1 / ((p + 1) * (p + q + 2)), abs=2e-15)


@EACH
def test_symmetry(scheme: Scheme) -> None:
    np.testing.assert_allclose(scheme.nodes + scheme.nodes[::-1], 1.0, atol=1e-15)
    np.testing.assert_array_equal(scheme.weights, scheme.weights[::-1])


@pytest.mark.compiled
@EACH
def test_measured_order(scheme: Scheme) -> None:
    """At a small arc (eps = theta^2/16 = 1e-5) the first term of the error rules: order 2, 8 or 10."""
    system, start, times = plain(2 * math.pi), np.array([0.013, 0.0]), np.arange(0.0, 40.5, 1.0)
    best = splitting.march(system, start, times, Fraction(1), 64, scheme)
    errors = [
        np.max(np.abs(splitting.march(system, start, times, Fraction(1), steps, scheme) - best)) for steps in (4, 6)
    ]
    order = math.log(errors[0] / errors[1]) / math.log(1.5)
    assert order > scheme.orders[0] - 1.5  # steps that divide the swing do better still
    large = np.array([0.8, 0.0])  # eps = 0.04: the later terms take over
    best = splitting.march(system, large, times, Fraction(1), 256, scheme)
    errors = [
        np.max(np.abs(splitting.march(system, large, times, Fraction(1), steps, scheme) - best)) for steps in (32, 64)
    ]
    assert scheme.orders[2] - 0.5 < math.log2(errors[0] / errors[1]) < scheme.orders[0] + 0.5


def _swell(resonant: float | None) -> DrivenPendulums:
    """A pair under swell, heave, damping, and a harmonic at or near resonance with the first."""
    n = 2 * math.pi / np.array([1.00966, 1.00976])
    rates, sizes = np.array([0.7, 1.1, 0.9]), np.array([0.1, 0.04, 0.0])
    if resonant is not None:
        rates, sizes = np.append(rates, n[0] * (1 + resonant)), np.append(sizes, 4e-4)
    return DrivenPendulums(
        n,
        9.81,
        horizontal=harmonics(sizes, rates, 0.3),
        vertical=harmonics([0.3], [0.8], [1.0]),
        terms=Viscous(np.array([1e-4, 2e-3])),
    )


@pytest.mark.compiled
@EACH
@pytest.mark.parametrize("resonant", [None, 0.0, 1e-12, 1e-3])
def test_agrees_with_the_explicit_method(resonant: float | None, scheme: Scheme) -> None:
    system, start, times = _swell(resonant), [0.02, 0.01, -0.01, 0.03], np.arange(0.0, 60.01, 0.05)
    one = splitting.integrate(system, start, times, tolerance=1e-13, scheme=scheme)
    other = explicit.integrate(system, start, times, tolerance=1e-14)
    apart = np.max(np.abs(one.states - other.states) / np.max(np.abs(other.states), axis=0))
    if scheme.orders[2] > 2:
        assert apart < 2e-13  # rounding of 1e4 steps
    assert one.estimated_error / 1000.0 <= apart <= 10.0 * one.estimated_error


def test_agrees_with_the_explicit_method_in_short() -> None:
    system, start, times = _swell(1e-3), [0.02, 0.01, -0.01, 0.03], [10.0, 10.5, 11.0]
    one = splitting.integrate(system, start, times, tolerance=1e-9)
    other = explicit.integrate(system, start, times, tolerance=1e-10)
    assert np.max(np.abs(one.states - other.states)) < 1e-10
    assert one.estimated_error < 1e-9


@pytest.mark.compiled
def test_energy_does_not_drift() -> None:
    """28.3 steps a swing: bounded at 2e-14. At eight, a whole number, the scheme resonates and drifts to 7e-11."""
    system, times = plain(2 * math.pi), np.arange(0.0, 10001.0, 10.0)
    states = splitting.march(system, np.array([0.1, 0.0]), times, Fraction(10), 283, SCHEMES["ABA(10,6,4)"])
    levels = np.array([energy(state, system) for state in states])
    assert np.max(np.abs(levels / levels[0] - 1)) < 1e-12


def test_mirror_image_bitwise() -> None:
    system, start, times = _swell(None), np.array([0.2, 0.1, -0.1, 0.3]), [0.0, 0.5, 1.0]
    assert system.horizontal is not None
    image = system._replace(horizontal=opposite(system.horizontal))
    one = splitting.integrate(system, start, times, tolerance=1e-6).states
    np.testing.assert_array_equal(splitting.integrate(image, -start, times, tolerance=1e-6).states, -one)


@pytest.mark.compiled
@pytest.mark.parametrize("end", [2.0, 5.0, 10.0, 20.0])
@pytest.mark.parametrize("frequency", [0.7, 3.1, 6.25])
def test_separatrix_is_right_or_told(frequency: float, end: float) -> None:
    """From the bottom at the rate 2n: tan(theta/4) = tanh(n t/2); beyond n t = 36 rounding decides where it falls."""
    times = np.linspace(0.0, end, 201)
    found = splitting.integrate(plain(frequency), [0.0, 2.0 * frequency], times, tolerance=1e-10)
    exact = 4.0 * np.arctan(np.tanh(0.5 * frequency * times))
    error = np.max(np.abs(found.states[:, 0] - exact)) / np.max(np.abs(found.states[:, 0]))
    assert error <= 10.0 * found.estimated_error
    assert found.estimated_error <= max(1e3 * error, 1e-12)


@pytest.mark.parametrize(
    ("system", "times", "reason"),
    [
        (plain(6.0)._replace(restoring=Linear()), [0.0, 1.0, 2.0], "full sine"),
        (plain(6.0)._replace(terms=Quadratic(np.array([0.1]))), [0.0, 1.0, 2.0], "viscous"),
        (plain(6.0)._replace(terms=Viscous(np.array([7.0]))), [0.0, 1.0, 2.0], "overdamped"),
        (plain(6.0), [0.0, 1.0, 2.5], "evenly"),
    ],
)
def test_refusals(system: Any, times: list[float], reason: str) -> None:
    with pytest.raises(RefusedError, match=reason):
        splitting.integrate(system, [0.1, 0.0], times)


def test_one_instant_is_the_start() -> None:
    assert splitting.integrate(plain(6.0), [0.1, 0.0], [3.0]).states.tolist() == [[0.1, 0.0]]


@pytest.mark.compiled
def test_no_phase_is_lost_near_resonance() -> None:
    """Ten minutes under a harmonic within a hundredth of n, against Picard collocation: phases are exact.

    With n t in doubles the error is forty times as large, and grows as t.
    """
    n, rate, size = 6.22159155, 6.1695, 2e-3
    system = DrivenPendulums(np.array([n]), 9.81, Sine(), harmonics(size, rate, 0.0), None, Viscous(np.array([1e-4])))
    start, times = np.array([0.015, 0.03]), np.arange(600 * 16 + 1) / 16.0
    found = splitting.march(system, start, times, Fraction(1, 16), 16, SCHEMES["ABA(10,6,4)"])[:, 0]
    still = HarmonicSum(np.zeros(0), np.zeros(0, dtype=np.complex128))
    swell = HarmonicSum(np.array([rate]), np.array([size + 0j]))
    even = EvenTimes(Fraction(1, 16), times.size)
    true = PicardPlan(np.array([n]), np.array([1e-4]), start.reshape(1, 2), swell, still, 9.81, even).elongation()[0][0]
    assert np.max(np.abs(found - true)) < 4e-15 * np.max(np.abs(true))
