"""Air bears a part of the pendulum and is carried along by it: the period is longer than in vacuum."""

from __future__ import annotations

from pipeline.conditions import AIR, by_temperature
from pipeline.ledger.entry import Case, Change

NAME = "air_density"
FORMULA = "T_vac = T - D rho/rho0, D what air of density rho0 adds to the period"
SOURCE = "calibrated coefficient (buoyancy and carried air); Vening Meinesz 1929"
NEEDS = AIR
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Reduce to vacuum, where instrument/period holds.

    The air's part is compared with the period that temperature has left, as both add to it.
    """
    constants = case.prepared.observation.constants
    density, reference = case.scalar("air_density"), case.scalar("air_density_reference")
    warm = case.period + float(by_temperature(constants)[1])
    after = gravity * (1.0 + case.pair("density_coefficient")[1] * density / reference / warm) ** 2
    own, owns = case.uncertainty("air_density"), case.uncertainties("density_coefficient")
    longer = case.pair("density_coefficient") / reference * (own or 0.0) / case.period
    sigma = case.sigma(
        air=None if own is None else case.of_periods(longer[0], longer[1]),
        coefficient=None if owns is None else case.independent(owns * density / reference / case.period),
    )
    return Change(after, sigma, f"{density:.4f} kg/m3, to vacuum")
