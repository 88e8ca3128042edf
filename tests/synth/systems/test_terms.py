"""Terms are composed by type, and the support's harmonics are exact at any time."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from system_examples import DRIVE, KNIFE, QUADRATIC, UPWARDS, VISCOUS, opposite

from synth.kernels.compiled import kernel
from synth.systems.terms import Both, Harmonics, Impulses, driven, halt, harmonics, jolt, motion, together


@kernel
def _total(term: Any) -> float:
    return driven(0.25, 1, 0.3, -0.7, term)


@kernel
def _level(time: float, term: Any) -> float:
    return motion(time, term)


def test_terms_add_up() -> None:
    alone = [_total(term) - 0.25 for term in (VISCOUS, QUADRATIC, KNIFE, DRIVE)]
    assert _total(together(VISCOUS, QUADRATIC, KNIFE, DRIVE)) == pytest.approx(0.25 + sum(alone), rel=1e-15)
    assert _total(None) == 0.25


def test_terms_are_what_their_formulas_say() -> None:
    rate, angle = -0.7, 0.3
    assert _total(VISCOUS) - 0.25 == pytest.approx(-2 * 0.02 * rate, rel=1e-14)
    assert _total(QUADRATIC) - 0.25 == pytest.approx(0.2 * rate**2, rel=1e-14)
    assert _total(KNIFE) - 0.25 == pytest.approx(0.01 * np.tanh(0.7 / 0.2), rel=1e-13)
    assert _total(DRIVE) - 0.25 == pytest.approx(0.2 * (1 - (angle / 0.2) ** 2) * rate, rel=1e-14)


def test_impulses_come_at_even_times_and_keep_a_part() -> None:
    kept, angles, rates = np.array([[0.5, 1.0], [0.0, 2.0]]), np.array([[0.1, 0.0], [0.2, 0.3]]), np.ones((2, 2))
    kicks = Impulses(1.5, kept, angles, rates)

    @kernel
    def jolted(number: int, state: Any, given: Any) -> None:
        jolt(given, number, state)

    @kernel
    def halted(number: int, end: float, given: Any) -> float:
        return halt(given, number, end)

    state = np.array([1.0, 2.0, 3.0, 4.0, 9.0])
    jolted(0, state, kicks)
    assert state.tolist() == [0.6, 2.0, 3.0, 5.0, 9.0]
    jolted(1, state, kicks)
    assert state.tolist() == [0.2, 1.0, 6.3, 11.0, 9.0]
    jolted(1, state, None)
    assert state[0] == 0.2
    assert [halted(number, 10.0, kicks) for number in (0, 1, 2)] == [1.5, 3.0, 10.0]
    assert (halted(1, 2.0, kicks), halted(0, 2.0, None)) == (2.0, 2.0)


def test_folding_leaves_out_what_is_absent() -> None:
    assert together(None, VISCOUS, None) is VISCOUS
    assert together(VISCOUS, KNIFE) == Both(VISCOUS, KNIFE)
    assert motion(0.0, None) is None


def test_a_type_without_the_role_is_named() -> None:
    with pytest.raises(Exception, match=r"(?s)(driven|Harmonics)"):
        _total(UPWARDS)


@pytest.mark.parametrize("time", [0.0, -3.7, 1234.5678, 86400.3, 1e7 + 0.1])
def test_harmonics_are_exact_at_long_times(time: float) -> None:
    rng = np.random.default_rng(5)
    amplitude, rate, phase = rng.normal(size=33), rng.uniform(0.01, 60.0, 33), rng.uniform(-9, 9, 33)
    amplitude[0], rate[1] = 0.0, 0.0
    with mpmath.workdps(40):
        exact = mpmath.fsum(
            mpmath.mpf(a) * mpmath.cos(mpmath.mpf(w) * mpmath.mpf(time) + mpmath.mpf(p))
            for a, w, p in zip(amplitude, rate, phase, strict=True)
        )
    # two roundings of 1e-16 a harmonic; plain doubles err by 1e-8 at 1e7 s
    assert abs(_level(time, harmonics(amplitude, rate, phase)) - float(exact)) < 1e-15 * np.abs(amplitude).sum()


def test_harmonics_broadcast_and_are_odd_in_amplitude() -> None:
    swell = harmonics([0.3, 0.1], 2.0, [0.0, 1.0])
    assert isinstance(swell, Harmonics)
    assert swell.table.shape == (5, 2)
    assert _level(0.37, opposite(swell)) == -_level(0.37, swell)
