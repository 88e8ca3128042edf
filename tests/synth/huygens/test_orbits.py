"""Periodic orbits against the balance, Floquet growth against theory, mirror and saddle to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from paper_criterion import paper_regime_holds

from data_schemas.errors import RefusedError, UsageError
from synth.huygens.balance import Regime, solutions
from synth.huygens.clocks import Clocks, mirrored, perturbed
from synth.huygens.locking import orbit_slope, slope
from synth.huygens.orbit import carried, orbit, orbits, start_of
from synth.huygens.paper import COUPLING, DAMPING, corrected
from synth.integrators.collocation import integrate
from synth.systems.reduced_beam import ReducedBeam, reduced
from synth.systems.starts import symmetric

PAIR = Clocks(0.02, 0.02, COUPLING, (-0.0114, -0.0114))
ARC = PAIR._replace(swing=0.1)


def of_chain(alpha: float, drive: float, swing: float = 0.0) -> Clocks:
    chain = corrected(alpha, drive, DAMPING, COUPLING)
    stretch = math.sqrt(1.0 + float(chain.beta))
    tau = float(chain.tau) + (swing * float(chain.amplitude)) ** 2 / 8.0 / stretch**2
    return Clocks(DAMPING / stretch, drive / stretch, COUPLING, (tau, tau), swing)


def nearest(clocks: Clocks, alpha: float) -> Regime:
    return min(solutions(clocks, shifts=True), key=lambda each: abs(each.alpha[0] - alpha) + abs(each.offset))


def test_reference_trajectory_a() -> None:
    """Formula sheet 3.2, A: tangents along it by differences."""
    system = ReducedBeam(0.02, 0.02, 7.142857142857e-6, np.array([-0.01139, -0.01141]))
    start = np.array([0.0, 0.0, 2.0, 0.0, 1.0, -1.5])
    states, tangents = carried(system, start, 4.0, 64)
    for column in (1, 4):
        moved = np.zeros(6)
        moved[column] = 1e-5
        ends = [carried(system, start + sign * moved, 4.0, 64)[0][-1] for sign in (1.0, -1.0)]
        assert np.abs((ends[0] - ends[1]) / 2e-5 - tangents[:, column]).max() < 1e-9
    assert states.shape == (65, 6)


@pytest.mark.compiled
def test_reference_trajectory_a_to_its_end() -> None:
    """s = 1000, printed to 12 digits; two independent integrators agreed on it to 6e-12."""
    system = ReducedBeam(0.02, 0.02, 7.142857142857e-6, np.array([-0.01139, -0.01141]))
    states, _ = carried(system, np.array([0.0, 0.0, 2.0, 0.0, 1.0, -1.5]), 1000.0, 15_000)
    expected = [9.5683187619e-5, 5.2287080973e-5, 0.693916614425, -1.857702623946, -1.820363617138, -0.814847412871]
    assert np.abs(states[-1] - expected).max() < 2e-11


def test_the_mirror_to_the_last_bit() -> None:
    """phi_i -> -phi_i of both, and of each alone."""
    for system, size in ((PAIR.detuned(1e-3).small(), 1.0), (ARC.detuned(1e-3).full(), 0.1)):
        start = np.array([0.01, 0.0, 2.0 * size, 0.0, 0.7 * size, -1.5 * size])
        one = np.array([1.0, 1.0, -1.0, -1.0, 1.0, 1.0])
        states = carried(system, start, 3.0, 8)[0]
        assert np.array_equal(carried(system, mirrored(start), 3.0, 8)[0], mirrored(states))
        assert np.array_equal(carried(system, one * start, 3.0, 8)[0], one * states)


@pytest.mark.compiled
def test_a_symmetric_start_stays_on_the_saddle_and_is_told() -> None:
    """To the last bit for 300 swings; moved by a millionth it leaves for quadrature."""
    system = PAIR.small()
    start = start_of(nearest(PAIR, -0.5))
    start[4:] = -start[2:4]
    assert symmetric(system, start)
    times = np.linspace(0.0, 12_000.0, 2401)
    stays = integrate(system, start, times[:400], tolerance=1e-9).states
    assert np.array_equal(stays[:, 2], -stays[:, 4])
    beside = perturbed(system, start, 5)
    assert not symmetric(system, beside)
    assert np.array_equal(perturbed(system, beside, 5), beside)
    leaves = integrate(system, beside, times, tolerance=1e-9).states
    phases = np.arctan2(-leaves[:, [3, 5]], leaves[:, [2, 4]])
    assert abs(math.remainder(phases[0, 0] - phases[0, 1], math.pi)) < 1e-5
    assert abs(math.remainder(phases[-1, 0] - phases[-1, 1], math.pi)) == pytest.approx(0.5 * math.pi, abs=0.03)


def test_unlike_clocks_are_not_symmetric() -> None:
    state = np.array([0.0, 0.0, 2.0, 0.0, 2.0, 0.0])
    assert symmetric(ARC.full(), state)
    assert not symmetric(ARC.detuned(1e-9).full(), state)
    with pytest.raises(UsageError, match="give one a swing"):
        perturbed(PAIR.small(), np.zeros(6), 1)


@pytest.mark.compiled
@pytest.mark.parametrize("drive", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("alpha", [-0.35, -0.25 * math.pi, -1.1])
def test_orbits_of_system_2_against_theory(alpha: float, drive: float) -> None:
    """beta of (14) to 2e-4 (it is 2e-7), k of the balance to 0.1 %, growth -q sin 2 alpha to 3 % (are 0.01, 0.2)."""
    clocks, chain = of_chain(alpha, drive), corrected(alpha, drive, DAMPING, COUPLING)
    regime = nearest(clocks, alpha)
    found = orbit(regime, clocks)
    assert found.residual < 1e-13
    assert found.error < 1e-12
    assert found.regime.beta == pytest.approx(float(chain.beta), abs=1e-6)
    assert found.stable is False
    assert found.growth == pytest.approx(float(chain.growth), rel=0.005)
    assert orbit_slope(regime, clocks) == pytest.approx(slope(regime, clocks, shifts=True), rel=3e-4)


@pytest.mark.compiled
def test_three_coexisting_orbits() -> None:
    """delta0 = .002, delta = .2, tau = .005: all three found, each another one; and quadrature, which attracts."""
    found = orbits(Clocks(0.002, 0.2, COUPLING, (0.005, 0.005)))
    in_phase = [each for each in found if abs(each.regime.offset) < 1e-6]
    assert [each.regime.beta for each in in_phase] == pytest.approx([-0.00726, 0.0, 0.00723], abs=5e-5)
    assert [each.stable for each in in_phase] == [False] * 3
    assert [each.stable for each in found if abs(each.regime.offset) > 1.0] == [True]


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("drive", "swing", "alpha"),
    [(0.02, 0.2, -1.4), (0.02, 0.2, -1.0), (0.005, 0.2, -1.1), (0.005, 0.2, -0.5), (0.005, 0.05, -1.4)],
)
def test_the_papers_regime_in_the_full_system(drive: float, swing: float, alpha: float) -> None:
    """Stable iff beta < 0, |beta|/delta0 > 2 delta/Phi0^2 and G > 1/2."""
    clocks = of_chain(alpha, drive, swing)
    regime = nearest(clocks, alpha)
    assert orbit(regime, clocks, full=True).stable is paper_regime_holds(regime.alpha[0], clocks, regime.beta)


@pytest.mark.campaign
def test_the_papers_regime_in_the_full_system_everywhere() -> None:
    """216 places on both sides of every condition."""
    held = 0
    for swing in (0.05, 0.1, 0.2):
        for drive, damping in ((0.02, 0.02), (0.005, 0.02), (0.002, 0.01), (0.001, 0.02)):
            for coupling in (0.1 * drive * damping, 0.5 * drive * damping, 2.0 * drive * damping):
                for alpha in (-0.3, -0.7, -0.9, -1.1, -1.25, -1.4):
                    chain = corrected(alpha, drive, damping, coupling)
                    stretch = math.sqrt(1.0 + float(chain.beta))
                    tau = float(chain.tau) + (swing * float(chain.amplitude)) ** 2 / 8.0 / stretch**2
                    clocks = Clocks(damping / stretch, drive / stretch, coupling, (tau, tau), swing)
                    regime = nearest(clocks, alpha)
                    expected = paper_regime_holds(regime.alpha[0], clocks, regime.beta)
                    assert orbit(regime, clocks, full=True).stable is expected, clocks
                    held += expected
    assert held == 67


def test_no_orbit_is_refused_and_steps_are_checked() -> None:
    with pytest.raises(UsageError, match="multiple of 4"):
        orbit(Regime(0.0, 0.0, (0.0, 0.0), (2.0, 2.0)), PAIR, steps=7)
    with pytest.raises(RefusedError, match="does not settle"):
        orbit(Regime(0.0, 0.0, (0.0, 0.0), (0.0, 0.0)), PAIR, steps=8)


def test_clocks_of_a_beam_and_back() -> None:
    given = Clocks(0.02, 0.015, 4e-5, (-0.011, -0.013), 0.12)
    back, _, _, angles = reduced(given.full())
    # one mean length stands for both: it differs from 1 by the mean detuning
    assert tuple(back.detuning) == pytest.approx(given.detuning, abs=1e-12)
    assert (back.beam_damping, back.drive) == pytest.approx((0.02, 0.015), rel=1e-12)
    assert (8.0 * back.coupling, angles.mean()) == pytest.approx((4e-5, 0.12), rel=0.03)
    with pytest.raises(UsageError, match="too small for this coupling"):
        given._replace(swing=1e-3).full()
    with pytest.raises(UsageError, match="needs an arc"):
        PAIR.full()


def test_daily_difference() -> None:
    """By the frequencies themselves: n = day (w1 - w2)/(2 pi)."""
    tau, chi, period = -0.0511, 1e-5, 1.0
    fast = 2.0 * math.pi / period / math.sqrt(1.0 + tau)  # w0/2
    frequencies = [fast * math.sqrt(1.0 + tau + sign * chi / 2.0) for sign in (1.0, -1.0)]
    swings = 86400.0 * (frequencies[0] - frequencies[1]) / (2.0 * math.pi)
    assert 2.0 * (1.0 + tau) * swings * period / 86400.0 == pytest.approx(chi, rel=1e-9)
