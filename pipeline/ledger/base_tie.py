"""The tie to base stations before and after a cruise: the periods' drift, and its misclosure."""

from __future__ import annotations

import numpy as np

from pipeline.conditions import BASE, Tie
from pipeline.ledger.entry import MGAL, Case, Change, absent

NAME = "base_tie"
FORMULA = "g = g_base (T_base/T)^2, T_base on the straight line between the bases before and after"
SOURCE = "relative measurement, linear drift; wandering drift: standard deviation of a Brownian bridge"
NEEDS: tuple[str, ...] = ()  # without bases the stated period counts, with its own uncertainty
USES = (*BASE, "base_period_uncertainty", "base_gravity_uncertainty", "period_uncertainty")


def change(case: Case, gravity: float) -> Change:
    """Replace the stated period of the second pendulum by that of the tie."""
    seen = case.prepared.observation
    drift = abs(case.by_ratio + case.by_period) * float(seen.period_relative_uncertainty[1])
    if case.estimate.of_mean:  # the joint fit holds it
        drift = 0.0
    if seen.tie is None:
        missing = absent(seen.constants, BASE)
        return Change(gravity, drift, f"{missing}: instrument/period counts as it is", applied=False)
    after = gravity * float(seen.tie.period[1] / case.period) ** 2
    heavy = None if seen.tie.gravity_uncertainty is None else seen.tie.gravity_uncertainty / MGAL
    sigma = case.sigma(drift=drift if seen.tie.stated else None, heavy=heavy)
    return Change(after, sigma, told(seen.tie))


def told(found: Tie) -> str:
    """The drift in words."""
    if np.isnan(found.misclosure):
        return "bases on one side of the record only: the period is held, its drift is not known"
    return (
        f"misclosure {found.misclosure:+.3f} +- {found.misclosure_uncertainty:.3f} mGal, "
        f"record at {100.0 * found.fraction:.0f} % of the way"
    )
