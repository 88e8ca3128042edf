"""Estimates are honest: the true error is below ten times the estimate, and above a thousandth of it."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from test_explicit import BEAM_A, BEAM_B, BEAM_C, START_A, START_B, START_C

from data_schemas.errors import RefusedError
from synth.integrators.explicit import TIGHTEST, instants, integrate, refine
from synth.integrators.explicit_march import Run
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums, Linear
from synth.systems.resistance import VanDerPol, Viscous
from synth.systems.terms import harmonics
from tests.synth.systems.system_examples import plain

SWING = 2 * math.pi


def ship(size: float, gravity_share: float = 0.0) -> DrivenPendulums:
    """Two pendulums and 33 harmonics each way; `gravity_share` adds waves of so many g."""
    rng = np.random.default_rng(1)
    rates, phases = SWING / rng.uniform(4.0, 20.0, 33), rng.uniform(0.0, SWING, 33)
    across, along = size * rng.uniform(0.0, 0.02, 33), size * rng.uniform(0.0, 0.015, 33)
    across[:2] += gravity_share * 9.81
    along[:2] += gravity_share * 9.81
    return DrivenPendulums(
        SWING / np.array([1.0, 1.01]),
        9.81,
        horizontal=harmonics(across, rates, phases),
        vertical=harmonics(along, 1.03 * rates, phases + 1.0),
        terms=Viscous(np.array([1e-4, 2e-4])),
    )


CASES: dict[str, tuple[Any, list[float], float]] = {
    "A": (BEAM_A, START_A, 1000.0),
    "B": (BEAM_B, START_B, 100.0),
    "C1": (BEAM_C, START_C, 10.0),
    "C1 until it is chaos": (BEAM_C, START_C, 100.0),
    "ship": (ship(1.0), [0.02, 0.0, -0.01, 0.05], 300.0),
    "two g each way": (ship(1.0, 1.0), [0.3, 0.0, 0.1, 0.0], 20.0),
    "over the top": (plain(SWING), [0.0, 13.0], 50.0),
    "3.1 rad": (plain(SWING), [3.1, 0.0], 50.0),
    "van der Pol 1": (VanDerPol(1.0), [2.0, 0.0], 100.0),
    "van der Pol 10": (VanDerPol(10.0), [2.0, 0.0], 100.0),
}


def true_error(found: Floats, best: Floats, scale: Floats) -> float:
    return float(np.max(np.abs(found - best) / scale))


@pytest.mark.campaign
@pytest.mark.parametrize("name", list(CASES))
def test_estimates_are_honest_at_every_tolerance(name: str) -> None:
    """Against the tightest march, whose own error, by its estimate, is below the errors judged."""
    system, start, end = CASES[name]
    times = np.linspace(0.0, end, 101)
    first = np.array(start, dtype=float)
    best = integrate(system, start, times, tolerance=1e-15)
    tightest = Run(system, None, first, times, TIGHTEST)
    for tolerance in 10.0 ** -np.arange(4.0, 14.0):
        made = refine(system, None, first, times, tolerance)
        if made.estimated_error < 30.0 * best.estimated_error:
            break
        error = true_error(integrate(system, start, times, tolerance=tolerance).states, tightest.states, tightest.scale)
        assert made.estimated_error / 1000.0 <= error <= 10.0 * made.estimated_error
        assert made.estimated_error <= tolerance


@pytest.mark.compiled
@pytest.mark.parametrize("amplitude", ["1e-6", "1", "3.1", "3.1415"])
def test_estimates_are_honest_down_to_rounding(amplitude: str) -> None:
    """A plain pendulum by Jacobi's functions; near the top of the swing rounding grows a millionfold."""
    times = np.linspace(0.0, 6.0, 50)
    with mpmath.workdps(40):
        k = mpmath.sin(mpmath.mpf(float(amplitude)) / 2)
        phases = [mpmath.mpf(SWING) * mpmath.mpf(float(time)) for time in times]
        exact = np.array([float(2 * mpmath.asin(k * mpmath.ellipfun("cd", phase, m=k**2))) for phase in phases])
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13, 1e-15):
        found = integrate(plain(SWING), [float(amplitude), 0.0], times, tolerance=tolerance)
        error = float(np.max(np.abs(found.states[:, 0] - exact))) / float(amplitude)
        assert found.estimated_error / 1000.0 <= error <= 10.0 * found.estimated_error
        if amplitude in ("1e-6", "1") and tolerance > 1e-14:
            assert found.estimated_error <= tolerance


def test_estimate_is_honest_in_short() -> None:
    found = integrate(DrivenPendulums(np.array([6.0]), restoring=Linear()), [0.1, 0.0], [0.0, 1.0], tolerance=1e-7)
    error = abs(found.states[1, 0] - 0.1 * math.cos(6.0)) / 0.1
    assert error <= 10.0 * found.estimated_error <= 1e-6


@pytest.mark.compiled
def test_chaos_is_named_by_the_estimate() -> None:
    """A pendulum thrown over and over by its support: errors grow e-fold again and again, until nothing is known."""
    system, start = DrivenPendulums(np.array([SWING]), 9.81, horizontal=harmonics([15.0], [4.1], [0.0])), [0.3, 0.0]
    short = integrate(system, start, [0.0, 10.0], tolerance=1e-9)
    long = integrate(system, start, [0.0, 300.0], tolerance=1e-9)
    assert short.estimated_error < 1e-6
    assert long.estimated_error > 0.01


def separatrix_error(frequency: float, times: Floats, states: Floats) -> float:
    """From the bottom at the rate 2n: tan(theta/4) = tanh(n t/2), up to the top and no further."""
    turns = frequency * times
    angle, rate = 4.0 * np.arctan(np.tanh(0.5 * turns)), 2.0 * frequency / np.cosh(np.minimum(turns, 700.0))
    exact = np.stack([angle, rate], axis=1)
    return float(np.max(np.abs(states - exact) / np.max(np.abs(states), axis=0)))


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10, 1e-13])
@pytest.mark.parametrize("end", [1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 100.0])
@pytest.mark.parametrize("frequency", [0.7, 1.0, 3.1, 6.25, 9.3])
def test_separatrix_is_right_or_told(frequency: float, end: float, tolerance: float) -> None:
    """Errors grow as e^{nt}, all marches may fall to one side: the answer is near, or its estimate is large.

    An estimate may be ten thousand times the error here: where rounding is about to decide, it is drawn but once.
    """
    times = np.linspace(0.0, end, 401)
    try:
        found = integrate(plain(frequency), [0.0, 2.0 * frequency], times, tolerance=tolerance)
    except RefusedError as refusal:
        reason = str(refusal)
    else:
        reason = ""
    if reason:
        assert "top of a swing" in reason
        return
    error = separatrix_error(frequency, times, found.states)
    assert error <= 10.0 * found.estimated_error
    assert found.estimated_error <= max(1e4 * error, 1e-13)


def test_separatrix_is_told_in_short() -> None:
    times = np.linspace(0.0, 10.0, 101)
    found = integrate(plain(6.25), [0.0, 12.5], times, tolerance=1e-4)
    assert separatrix_error(6.25, times, found.states) > 0.1
    assert found.estimated_error > 0.1


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10, 1e-13])
def test_at_rest_at_the_top_is_refused_by_name(tolerance: float) -> None:
    """The double next to pi is 1.2e-16 off it: rounding, not the motion, decides when and where it falls."""
    with pytest.raises(RefusedError, match="top of a swing where rounding decides"):
        integrate(plain(6.25), [math.pi, 0.0], np.linspace(0.0, 20.0, 401), tolerance=tolerance)


def test_instants_of_comparison_do_not_beat() -> None:
    found = instants(0.0, 10.0)
    assert found[0] == 0.0
    assert found[-1] == 10.0
    assert np.all(np.diff(found) > 0.0)
    assert np.ptp(np.diff(found)[:-1]) > 0.02
    np.testing.assert_array_equal(instants(3.0, 3.0), [3.0])
