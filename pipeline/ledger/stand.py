"""Corrections for the plane of swing, which tilts, turns and rocks; each from one stated number but for `planes`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.ledger.entry import DAY, MGAL, Case, Change, Correction, correction

PER_RADIAN, OF = 21.0, 0.07  # mGal, at a root mean square of y'', m s-2


def _by_number(
    name: str, formula: str, source: str, need: str, after: Callable[[Case, float, float], float], words: str
) -> Correction:
    """A correction by one number of /instrument: `after(case, gravity, number)`, 1 sigma by its central difference.

    `words` has a place for the number, `x`, its root, `rms`, or a thousand times this, `mrad`.
    """

    @correction(name, formula, source, (need,))
    def change(case: Case, gravity: float) -> Change:
        number, own = case.scalar(need), case.uncertainty(need)
        told = words.format(x=number, rms=abs(number) ** 0.5, mrad=1e3 * abs(number) ** 0.5)
        sigma = None
        if own is not None:
            sigma = 0.5 * (after(case, gravity, number + own) - after(case, gravity, number - own)) / MGAL
        return Change(after(case, gravity, number), case.sigma(sigma), told)

    return change


def _turning(case: Case, gravity: float, rate: float) -> float:
    true = case.estimate.frequency / (1.0 + case.prepared.observation.chronometer_rate / DAY)
    return gravity * (1.0 + rate**2 / true**2)


transverse_acceleration = _by_number(
    "transverse_acceleration",
    "-<y''^2>/(2g), where the plane of swing follows the apparent vertical",
    "Browne 1937, Mon. Not. R. astr. Soc. Geophys. Suppl. 4, 271",
    "transverse_acceleration_mean_square",  # no trace shows it, so it must be stated
    lambda case, gravity, square: gravity - square / (2.0 * gravity),
    "rms {rms:.4f} m/s2",
)
rocking = _by_number(
    "rocking",
    "-g <b'^2>/n^2, b' the rate at which the plane of swing turns about a horizontal axis",
    "centrifugal force in the turning plane, l b'^2 cos theta",
    "rocking_rate_mean_square",
    lambda case, gravity, square: gravity * (1.0 - square / case.estimate.frequency**2),
    "rms {rms:.4f} rad/s",
)
yaw = _by_number(
    "yaw",
    "g W^2/n^2, W the rate of turn of the plane, held by the case",
    "pendulum in a turning plane: theta'' + (n^2 - W^2 cos theta) sin theta = 0",
    "yaw_rate",
    _turning,
    "{x:+.5f} rad/s",
)
tilt = _by_number(
    "tilt",
    "g <b^2>/2, b the angle of the plane of swing out of the vertical",
    "component of gravity in the plane, g cos b; Vening Meinesz 1929",
    "tilt_mean_square",
    lambda case, gravity, square: gravity / (1.0 - 0.5 * square),  # the mean cosine
    "rms {mrad:.3f} mrad",
)


@correction(
    "planes",
    "near-resonant y'' leaks into the difference in proportion to the angle between the planes",
    "integrated: .21 mGal at 10 mrad, y'' of .1 m/s2 and near-resonant motion of 1e-4 of it",
    ("plane_angle",),
    uses=("transverse_acceleration_mean_square",),
)
def planes(case: Case, gravity: float) -> Change:
    """Planes of swing that are not parallel: nothing can be reduced without y''; what it may do is in sigma."""
    apart, own = float(np.ptp(case.pair("plane_angle"))), case.uncertainty("plane_angle")
    if own is not None:
        apart = float(np.hypot(apart, np.hypot(*own)))
    name = "transverse_acceleration_mean_square"
    across = case.scalar(name) ** 0.5 if name in case.prepared.observation.constants else OF
    return Change(gravity, PER_RADIAN * apart * across / OF, f"{1e3 * apart:.2f} mrad apart; only sigma holds it")
