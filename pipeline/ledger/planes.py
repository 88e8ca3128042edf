"""Planes of swing that are not parallel: each pendulum feels some of the acceleration across."""

from __future__ import annotations

import numpy as np

from pipeline.ledger.entry import Case, Change

NAME = "planes"
FORMULA = "near-resonant y'' leaks into the difference in proportion to the angle between the planes"
SOURCE = "integrated: .21 mGal at 10 mrad, y'' of .1 m/s2 and near-resonant motion of 1e-4 of it"
NEEDS = ("plane_angle",)
USES = ("transverse_acceleration_mean_square",)

PER_RADIAN, OF = 21.0, 0.07  # mGal, at a root mean square of y'', m s-2


def change(case: Case, gravity: float) -> Change:
    """Nothing can be reduced without y''; what it may do is in sigma."""
    apart = float(np.ptp(case.pair(NEEDS[0])))
    own = case.uncertainties(NEEDS[0])
    if own is not None:
        apart = float(np.hypot(apart, np.hypot(*own)))
    across = case.scalar(USES[0]) ** 0.5 if USES[0] in case.prepared.observation.constants else OF
    return Change(gravity, PER_RADIAN * apart * across / OF, f"{1e3 * apart:.2f} mrad apart; only sigma holds it")
