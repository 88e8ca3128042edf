"""beta, q, tau and k of the paper's regime over alpha: by paper, corrected chain, balance, orbit and motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from synth.huygens.balance import Regime, solutions
from synth.huygens.clocks import Clocks
from synth.huygens.offset import orbit_slope, slope
from synth.huygens.orbit import orbit, start_of
from synth.huygens.paper import COUPLING, DAMPING, Chain, corrected, printed
from synth.integrators.collocation import integrate

Row = dict[str, Any]
WAYS = ("paper", "corrected chain", "balance", "orbit", "motion")
DRIVE = 0.02
"""delta, of which the paper gives none."""
_A_SWING = 16  # readings


def rows(alphas: Sequence[float]) -> list[Row]:
    """One row an alpha and way. Balance, orbit and motion are of the clocks that the corrected chain finds."""
    table = []
    for alpha in alphas:
        clocks = clocks_of(corrected(alpha, DRIVE))
        regime = nearest(clocks, alpha)
        found = orbit(regime, clocks)
        table += [
            *closed(alpha),
            _of(regime, "balance", clocks, slope(regime, clocks, shifts=True)),
            _of(found.regime, "orbit", clocks, orbit_slope(regime, clocks)) | {"stable": found.stable},
            _of(moved(regime, clocks), "motion", clocks, math.nan),
        ]
    return table


def closed(alpha: float) -> list[Row]:
    """Rows of the ways that are formulas: the paper's and the corrected chain."""
    ways = zip(WAYS, (printed(alpha), corrected(alpha, DRIVE)), strict=False)
    return [_row(way, alpha, chain.beta, chain.q, chain.tau, chain.slope) for way, chain in ways]


def clocks_of(chain: Chain) -> Clocks:
    """Clocks, equal ones, whose regime has the chain's alpha at the chain's delta0 and delta."""
    stretch = math.sqrt(1.0 + float(chain.beta))
    tau = float(chain.tau)
    return Clocks(DAMPING / stretch, DRIVE / stretch, COUPLING, (tau, tau))


def nearest(clocks: Clocks, alpha: float) -> Regime:
    """The fixed point of the slow flow that is in phase, at this alpha."""
    return min(solutions(clocks, shifts=True), key=lambda each: abs(each.alpha[0] - alpha) + abs(each.offset))


def moved(regime: Regime, clocks: Clocks, swings: int = 400) -> Regime:
    """The regime as equal clocks that begin alike move, which stay on it to the last bit, saddle though it is."""
    first = np.array(start_of(regime))
    first[:2] *= 0.9  # not quite on it: the motion must lead there
    step = 2.0 * math.pi / _A_SWING * math.sqrt(1.0 + regime.beta)
    states = integrate(clocks.small(), first, np.arange(swings * _A_SWING) * step, tolerance=1e-10).states
    late = states[len(states) // 2 :]
    time = np.arange(len(late)) * step
    swing = np.unwrap(np.angle(late[:, 2] - 1j * late[:, 3]))
    frequency = float(np.polyfit(time, swing, 1)[0])  # of the clocks; z = frequency s
    turns = np.exp(-1j * frequency * time)
    window = np.hanning(len(late))
    clock = complex(2.0 * np.sum(window * late[:, 2] * turns) / window.sum())
    beam = complex(-4.0 * np.sum(window * late[:, 0] * turns**2) / window.sum())
    alpha = math.remainder(0.5 * float(np.angle(beam)) - float(np.angle(clock)), math.pi)
    return Regime(1.0 / frequency**2 - 1.0, abs(beam), (alpha, alpha), (abs(clock), abs(clock)))


def _of(regime: Regime, way: str, clocks: Clocks, k: float) -> Row:
    return _row(way, 0.5 * (regime.alpha[0] + regime.alpha[1]), regime.beta, regime.q, clocks.mean_detuning, k)


def _row(way: str, alpha: float, beta: Any, q: Any, tau: Any, k: Any) -> Row:
    values = {"beta": float(beta), "q": float(q), "tau": float(tau), "k": float(k)}
    return {"way": way, "alpha": float(alpha), **values, "stable": None}
