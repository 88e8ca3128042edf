"""Theory of two clocks on an elastic beam (Kanunnikov and Lamper), and past it: what locks, where, and what is stable.

`paper` the printed and corrected chain (10)-(14); `balance` every solution of (7)-(8); `orbit` the true periodic
motions with Floquet multipliers; `locking` stability, k, edge and slip; `clocks` what theory speaks of.
"""

from synth.huygens.balance import Regime, residuals, solutions
from synth.huygens.clocks import Clocks, perturbed
from synth.huygens.locking import edge, edge_of_balance, orbit_slope, slip, slope, stability
from synth.huygens.orbit import Orbit, orbits
from synth.huygens.paper import corrected, printed
from synth.systems.starts import symmetric

__all__ = [
    "Clocks", "Orbit", "Regime", "corrected", "edge", "edge_of_balance",
    "orbit_slope", "orbits", "perturbed", "printed", "residuals", "slip", "slope", "solutions", "stability",
    "symmetric",
]  # fmt: skip
