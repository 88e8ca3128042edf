"""Theory of two clocks on an elastic beam (Kanunnikov and Lamper), and past it: what locks, where, and what is stable.

`paper` the printed and corrected chain (10)-(14); `balance` every solution of (7)-(8); `slow_flow` their stability;
`orbit` the true periodic motions with Floquet multipliers; `locking` k, n and chi, edge and slip; `clocks` what theory
speaks of, and symmetry. Nothing is imported before it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from synth.huygens.balance import Regime, residuals, solutions
    from synth.huygens.clocks import Clocks, of_beam, perturbed, symmetric
    from synth.huygens.locking import chi_of_daily, daily_of_chi, edge, edge_of_balance, orbit_slope, slip, slope
    from synth.huygens.orbit import Orbit, orbits
    from synth.huygens.paper import corrected, printed
    from synth.huygens.slow_flow import stability

_HOMES = {
    "balance": ("Regime", "residuals", "solutions"),
    "clocks": ("Clocks", "of_beam", "perturbed", "symmetric"),
    "locking": ("chi_of_daily", "daily_of_chi", "edge", "edge_of_balance", "orbit_slope", "slip", "slope"),
    "orbit": ("Orbit", "orbits"),
    "paper": ("corrected", "printed"),
    "slow_flow": ("stability",),
}
_WHERE = {name: f"synth.huygens.{home}" for home, names in _HOMES.items() for name in names}

__all__ = [
    "Clocks", "Orbit", "Regime", "chi_of_daily", "corrected", "daily_of_chi", "edge", "edge_of_balance", "of_beam",
    "orbit_slope", "orbits", "perturbed", "printed", "residuals", "slip", "slope", "solutions", "stability",
    "symmetric",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'synth.huygens' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_WHERE[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
