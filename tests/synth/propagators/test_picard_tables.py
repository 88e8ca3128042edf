"""Collocation under a long table: its sums come by Fourier transform, and must be those of the harmonics."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from picard_cases import GRAVITY, HEAVE, STILL, N, make, motion

from data_schemas.scene_pendulum import StateStart
from synth.motion import tabulated
from synth.motion.harmonic_sum import HarmonicSum, add
from synth.motion.tabulated import continued
from synth.pendulums.linear import respond
from synth.propagators.picard import PicardPlan
from synth.propagators.times import EvenTimes, UnevenTimes

MOMENTS = (
    EvenTimes(Fraction(1, 20), 61),
    UnevenTimes(np.array([0.0, 0.3, 0.31, 2.9]), Fraction(1)),
)


def _table(size: float) -> HarmonicSum:
    """Read five times a second: the band of beats is in it."""
    return continued(size * np.random.default_rng(4).normal(size=1700), 0.2, 5.0)


@pytest.mark.parametrize("times", MOMENTS)
def test_linear_limit(times: EvenTimes | UnevenTimes) -> None:
    """Arcs of 1e-9 of which nothing is nonlinear, under a table beside other harmonics."""
    both = add([_table(1e-9), motion((0.6, 3e-9), (0.9 * N, 4e-10j))])
    theta, _ = make([(2e-9, 1e-9)], both, damping_rate=1e-3, times=times).elongation()
    response = respond(N, 1e-3, StateStart(angle=2e-9, angular_velocity=1e-9), both, GRAVITY)
    linear = times.elongation([response])
    # the table is not smooth: what its highest harmonics leave to collocation is resolved to 1e-13
    assert np.abs(theta - linear).max() <= 1e-12 * np.abs(linear).max()


@pytest.mark.parametrize("vertical", [STILL, HEAVE, "the same table"])
def test_the_same_table_harmonic_by_harmonic(vertical: HarmonicSum | str, monkeypatch: pytest.MonkeyPatch) -> None:
    def moved() -> PicardPlan:
        table = _table(0.05)
        heave = table if isinstance(vertical, str) else vertical
        return make([(0.05, 0.0), (0.0, 0.1)], table, heave, times=EvenTimes(Fraction(1, 20), 31))

    transformed = moved()
    assert transformed.horizontal.combs
    monkeypatch.setattr(tabulated, "LONG", 10_000)
    alone = moved()
    assert not alone.horizontal.combs
    theta = [plan.elongation()[0] for plan in (transformed, alone)]
    np.testing.assert_allclose(theta[0], theta[1], rtol=0, atol=1e-14)
    assert np.abs(replace(transformed, horizontal=STILL).elongation()[0] - theta[0]).max() > 1e-4
