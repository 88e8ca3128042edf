"""Theory of two clocks on an elastic beam (Kanunnikov and Lamper), and past it: what locks, where, and what is stable.

`paper` the printed and corrected chain (10)-(14); `balance` every solution of (7)-(8); `orbit` the true periodic
motions with Floquet multipliers; `locking` stability, k, n and chi, edge and slip; `clocks` what theory speaks of.
"""

from __future__ import annotations

from synth.huygens.balance import Regime, residuals, solutions
from synth.huygens.clocks import Clocks, of_beam, perturbed
from synth.huygens.locking import chi_of_daily, daily_of_chi, edge, edge_of_balance, orbit_slope, slip, slope, stability
from synth.huygens.orbit import Orbit, orbits
from synth.huygens.paper import corrected, printed
from synth.systems.starts import symmetric

__all__ = [
    "Clocks", "Orbit", "Regime", "chi_of_daily", "corrected", "daily_of_chi", "edge", "edge_of_balance", "of_beam",
    "orbit_slope", "orbits", "perturbed", "printed", "residuals", "slip", "slope", "solutions", "stability",
    "symmetric",
]  # fmt: skip
