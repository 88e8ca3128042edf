"""When theory says that the paper's regime holds."""

from __future__ import annotations

import math

from synth.huygens.clocks import Clocks


def paper_regime_holds(alpha: float, clocks: Clocks, beta: float) -> bool:
    """Whether theory finds the paper's regime alpha_1 = alpha_2 stable in the full system.

    Necessary and sufficient to leading order: beta < 0, |beta|/delta0 > 2 delta/Phi0^2, and G > 1/2, that is
    nu sin^2 2 alpha < delta delta0. Never in system (2), where Phi0 = 0.
    """
    stretch = math.sqrt(1.0 + beta)
    delta, damping = clocks.drive * stretch, clocks.beam_damping * stretch
    steep = abs(beta) * clocks.swing**2 > 2.0 * delta * damping
    return beta < 0.0 and steep and clocks.coupling * math.sin(2.0 * alpha) ** 2 < delta * damping
