"""Stability of regimes in the slow flow: the Jacobian, the saddle, quadrature, and when the paper's regime holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from paper_criterion import paper_regime_holds

from data_schemas.errors import UsageError
from synth.huygens.balance import solutions
from synth.huygens.clocks import Clocks, jacobian
from synth.huygens.locking import rates, stability
from synth.huygens.paper import COUPLING, corrected

PAIR = Clocks(0.02, 0.02, COUPLING, (-0.0114, -0.0114))


def test_slopes_are_those_of_the_rates() -> None:
    clocks = Clocks(0.02, 0.03, 1e-4, (-0.0114, -0.0117), 0.1)
    state, step = np.array([0.3, -0.5, 1.9, 2.1, 0.001, -0.002]), 1e-6
    found = jacobian(lambda each: rates(each, 0.01, clocks), state)
    moved = [rates(state + step * e, 0.01, clocks) - rates(state - step * e, 0.01, clocks) for e in np.eye(6)]
    assert np.abs(np.array(moved).T / (2.0 * step) - found).max() < 1e-10


def test_the_common_phase_is_neutral() -> None:
    """Turning z turns alpha by c and Q by -2c: rates are the same, turned."""
    state, turn = np.array([0.3, -0.5, 1.9, 2.1, 0.001, -0.002]), 0.7
    beam = (state[4] + 1j * state[5]) * np.exp(-2j * turn)
    one, two = (
        rates(state, 0.01, PAIR),
        rates(np.array([*(state[:2] + turn), *state[2:4], beam.real, beam.imag]), 0.01, PAIR),
    )
    assert two[:4] == pytest.approx(one[:4], abs=1e-15)
    assert complex(two[4], two[5]) == pytest.approx(complex(one[4], one[5]) * np.exp(-2j * turn), abs=1e-15)


@pytest.mark.parametrize("tau", [-0.05, -0.0114, 0.0, 0.013])
def test_in_system_2_the_papers_regime_is_a_saddle_and_quadrature_attracts(tau: float) -> None:
    clocks = PAIR._replace(detuning=(tau, tau))
    for regime in solutions(clocks, shifts=True):
        verdict = stability(regime, clocks)
        quadrature = abs(abs(regime.offset) - 0.5 * math.pi) < 1e-9
        assert verdict.stable is quadrature
        if not quadrature:
            assert sum(each.real > 0.0 for each in verdict.exponents) == 1
            assert verdict.growth == pytest.approx(-regime.q * math.sin(2.0 * regime.alpha[0]), rel=1e-6)


@pytest.mark.parametrize("swing", [0.05, 0.2])
@pytest.mark.parametrize(("drive", "damping", "share"), [(0.02, 0.02, 0.5), (0.001, 0.02, 0.5), (0.002, 0.01, 2.0)])
def test_in_the_full_system_it_holds_exactly_where_theory_says(
    swing: float, drive: float, damping: float, share: float
) -> None:
    """beta < 0, |beta|/delta0 > 2 delta/Phi0^2, G > 1/2: at alpha on both sides of each."""
    coupling = share * drive * damping
    seen = set()
    for alpha in (-0.3, -0.9, -1.4):
        chain = corrected(alpha, drive, damping, coupling)
        stretch = math.sqrt(1.0 + float(chain.beta))
        tau = float(chain.tau) + (swing * float(chain.amplitude)) ** 2 / 8.0 / stretch**2
        clocks = Clocks(damping / stretch, drive / stretch, coupling, (tau, tau), swing)
        regime = min(solutions(clocks, shifts=True), key=lambda each: abs(each.alpha[0] - alpha) + abs(each.offset))
        expected = paper_regime_holds(regime.alpha[0], clocks, regime.beta)
        assert stability(regime, clocks).stable is expected
        seen.add(expected)
    assert False in seen


def test_a_stranger_is_refused() -> None:
    with pytest.raises(UsageError, match="no fixed point"):
        stability(solutions(PAIR)[1], PAIR._replace(drive=0.1))
