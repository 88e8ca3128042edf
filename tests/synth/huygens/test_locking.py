"""Edge of locking and slip beyond it: the fold against the exact search, and both against motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from synth.huygens.balance import solutions
from synth.huygens.clocks import Clocks
from synth.huygens.locking import edge, edge_of_balance, mean_beta, slip, stability
from synth.integrators.collocation import integrate_ensemble

PAIRS = [Clocks(0.02, 0.02, 5.7143e-5, (tau, tau)) for tau in (0.0, -0.0114, -0.03)]


def adler(clocks: Clocks, chi: float, critical: float) -> float:
    """Adler's mean |d psi/dz| beyond the edge, `[(1 + beta)/2] sqrt(chi^2 - chi_c^2)`; 0 below it.

    By 2 to 8 % slower than the truth at delta0 = 0.02 and nu = 5.7e-5, even with the true edge.
    """
    return 0.5 * (1.0 + mean_beta(clocks)) * math.sqrt(max(chi * chi - critical * critical, 0.0))


@pytest.mark.parametrize("clocks", PAIRS, ids=lambda each: f"{each.mean_detuning:g}")
def test_the_fold_is_where_the_regimes_end(clocks: Clocks) -> None:
    """Just below the edge a stable and an unstable one, just above nothing; the leading order within 7 %."""
    critical = edge_of_balance(clocks)
    below = clocks.detuned(0.998 * critical)
    assert sorted(str(stability(each, below).stable) for each in solutions(below, shifts=True)) == ["False", "True"]
    assert solutions(clocks.detuned(1.002 * critical), shifts=True) == []
    assert edge(clocks) == pytest.approx(critical, rel=0.07)


def test_leading_order_is_reached() -> None:
    """At a tenth of the coupling the departure is a tenth."""
    departures = [
        edge(each) / edge_of_balance(each) - 1.0 for each in (PAIRS[0], PAIRS[0]._replace(coupling=5.7143e-6))
    ]
    assert departures[1] == pytest.approx(0.1 * departures[0], rel=0.2)


@pytest.mark.compiled
@pytest.mark.parametrize("clocks", PAIRS[:2], ids=lambda each: f"{each.mean_detuning:g}")
def test_motion_of_system_2_locks_and_slips_as_said(clocks: Clocks) -> None:
    """Locked at 0.98 of the fold, slipping at 1.05 and 1.5 within 2 % (asked 4 %); plain Adler within 8 %."""
    critical = edge_of_balance(clocks)
    shares = (0.98, 1.05, 1.5)
    times = np.linspace(0.0, 40_000.0, 20_001)
    start = np.array([0.0, 0.0, 2.0, 0.0, 0.1, 1.9])
    systems = [clocks.detuned(share * critical).small() for share in shares]
    states = integrate_ensemble(systems, np.tile(start, (3, 1)), times, tolerance=1e-9)
    turned = np.unwrap(np.arctan2(-states[..., 3::2], states[..., 2::2]), axis=1)
    psi = np.abs(turned[..., 0] - turned[..., 1])[:, 4000:]
    psi -= psi[:, :1]
    assert np.abs(psi[0]).max() < 0.5
    for share, course in zip(shares[1:], psi[1:], strict=True):
        slips = math.floor(course.max() / math.pi)
        passed = np.interp([0.0, slips * math.pi], course, times[4000:])
        measured = slips * math.pi / (passed[1] - passed[0]) * math.sqrt(1.0 + mean_beta(clocks))
        assert slip(clocks, share * critical) == pytest.approx(measured, rel=0.02)
        assert adler(clocks, share * critical, critical) == pytest.approx(measured, rel=0.08)


def test_no_slip_below_the_edge() -> None:
    critical = edge_of_balance(PAIRS[0])
    assert slip(PAIRS[0], 0.9 * critical) == 0.0
    assert adler(PAIRS[0], 0.9 * critical, critical) == 0.0


def test_a_slow_beam_lets_go_before_the_fold() -> None:
    """delta0 = 0.002 with delta = 0.2: the locked regime wavers at 0.6 of the fold, by the full list of regimes."""
    clocks = Clocks(0.002, 0.2, 5.7143e-5, (0.005, 0.005))
    critical = edge_of_balance(clocks)
    assert critical < 0.9 * 0.0267  # of the fold
    for share, expected in ((0.99, 1), (1.01, 0)):
        there = clocks.detuned(share * critical)
        assert sum(stability(each, there).stable is True for each in solutions(there, shifts=True)) == expected
