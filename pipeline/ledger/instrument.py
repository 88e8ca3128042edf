"""Corrections for clock, instrument and stand.

Chronometer, temperature, air, base stations, flexure of the support; the plane of swing, which tilts, turns and rocks.
"""

from collections.abc import Callable

import numpy as np

from pipeline.conditions import AIR, BASE, DAY, MGAL, TEMPERATURE, by_temperature
from pipeline.ledger.entry import Case, Change, Correction, absent, correction

PER_RADIAN, OF = 21.0, 0.07  # mGal, at a root mean square of y'', m s-2
RATE, TIMES = "chronometer_rate", "time_uncertainty"


@correction(
    "chronometer",
    "T_true = T (1 + r/86400), r in s a day, losing positive",
    "definition of the rate; Vening Meinesz 1929, Theory and Practice of Pendulum Observations at Sea",
    uses=(RATE, f"{RATE}_uncertainty"),  # none is needed: a stated rate of zero differs from none
)
def chronometer(case: Case, gravity: float) -> Change:
    """From the record's time to true time: a chronometer that loses shows periods too short."""
    seen = case.prepared.observation
    rate = seen.chronometer_rate
    own, times = case.uncertainty(RATE), seen.constants.get(TIMES)
    sigma = case.sigma(
        None if own is None else case.by_period * own / DAY, None if times is None else case.by_period * times
    )
    if rate == 0.0 and RATE not in seen.constants:
        reason = absent(seen.constants, (RATE,))
        if not times:
            return Change(gravity, 0.0, reason, applied=False)
        return Change(gravity, sigma, f"{reason}; sigma is that of record/{TIMES}", applied=False)
    return Change(gravity / (1.0 + rate / DAY) ** 2, sigma, f"rate {rate:+.3f} s/day")


@correction(
    "temperature",
    "T_ref = T - c (t - t_ref), c = expansion coefficient times T/2",
    "calibrated coefficient; Vening Meinesz 1929, Theory and Practice of Pendulum Observations at Sea",
    TEMPERATURE,
)
def temperature(case: Case, gravity: float) -> Change:
    """Compare with the period at the record's temperature; one that changes counts as it acts on the frequency."""
    constants = case.prepared.observation.constants
    mean, reference = case.scalar("temperature"), case.scalar("temperature_reference")
    warm, words = mean - reference, f"{mean:.2f} K"
    if "temperature_course" in constants:
        course = case.pair("temperature_course")
        warm = case.mean_over_record(course) - reference
        words = f"{course.min():.2f} to {course.max():.2f} K, acting as {warm + reference:.3f} K"
    coefficient = case.pair("temperature_coefficient") / case.period
    own, owns = case.uncertainty("temperature"), case.uncertainty("temperature_coefficient")
    sigma = case.sigma(
        None if own is None else case.of_periods(*coefficient * own),  # a thermometer that both pendulums share
        None if owns is None else case.independent(owns * warm / case.period),
    )
    after = gravity * (1.0 + coefficient[1] * warm) ** 2
    return Change(after, sigma, f"{words}, {warm:+.2f} K from the reference")


@correction(
    "air_density",
    "T_vac = T - D rho/rho0, D what air of density rho0 adds to the period",
    "calibrated coefficient (buoyancy and carried air); Vening Meinesz 1929",
    AIR,
)
def air_density(case: Case, gravity: float) -> Change:
    """Reduce to vacuum, where instrument/period holds; the air's part adds to the period that temperature has left."""
    density, reference = case.scalar("air_density"), case.scalar("air_density_reference")
    coefficient = case.pair("density_coefficient") / reference
    warm = case.period + float(by_temperature(case.prepared.observation.constants)[1])
    own, owns = case.uncertainty("air_density"), case.uncertainty("density_coefficient")
    sigma = case.sigma(
        None if own is None else case.of_periods(*coefficient * own / case.period),
        None if owns is None else case.independent(owns * density / reference / case.period),
    )
    return Change(gravity * (1.0 + coefficient[1] * density / warm) ** 2, sigma, f"{density:.4f} kg/m3, to vacuum")


@correction(
    "flexure",
    "one pendulum: T_rigid = T (1 - e), e = (m g/(2 K l)) (1 + (A2/A1) cos(Phi2-Phi1)); the difference: 0",
    "Peirce 1883, Report of the U.S. Coast and Geodetic Survey for 1881, App. 14; Panteleev 1958, (2), the sway as x''",
    ("support_stiffness", "mass", "length"),
)
def flexure(case: Case, gravity: float) -> Change:
    """Nothing is left to add; the reason names what either pendulum alone would need.

    The sway of the support is a horizontal acceleration common to both, `x'' = -n^2 sum m_j g theta_j / K`, and enters
    the equation of the difference as any other: multiplied by n1-n2, where the method removes it.
    """
    mass, length, stiffness = case.pair("mass"), case.pair("length"), case.scalar("support_stiffness")
    envelope = case.prepared.sliding
    first, second = envelope.first, envelope.first - envelope.difference
    present = np.isfinite(first) & np.isfinite(second)
    # both pull at once: m_i theta_i + m_j theta_j, its part in phase with theta_i
    cross = float(np.mean((first * second.conj())[present].real))
    squares = np.array([np.mean(np.abs(own[present]) ** 2) for own in (first, second)])
    longer = gravity * (mass * squares + mass[::-1] * cross) / (2.0 * stiffness * length * squares)
    alone = case.alone(*2.0 * gravity * longer / MGAL)
    return Change(gravity, 0.0, f"the difference sheds all sway of the support; {alone}")


@correction(
    "base_tie",
    "g = g_base (T_base/T)^2, T_base on the straight line between the bases before and after",
    "relative measurement, linear drift; wandering drift: standard deviation of a Brownian bridge",
    # without bases the stated period counts, with its own uncertainty
    uses=(*BASE, "base_period_uncertainty", "base_gravity_uncertainty", "period_uncertainty"),
)
def base_tie(case: Case, gravity: float) -> Change:
    """Replace the stated period of the second pendulum by that of the base stations before and after the cruise."""
    seen, tie = case.prepared.observation, case.prepared.observation.tie
    drift = abs(case.by_ratio + case.by_period) * float(seen.period_relative_uncertainty[1])
    if case.estimate.of_mean:  # the joint fit holds it
        drift = 0.0
    if tie is None:
        missing = absent(seen.constants, BASE)
        return Change(gravity, drift, f"{missing}: instrument/period counts as it is", applied=False)
    heavy = None if tie.gravity_uncertainty is None else tie.gravity_uncertainty / MGAL
    sigma = case.sigma(drift if tie.stated else None, heavy)
    words = "bases on one side of the record only: the period is held, its drift is not known"
    if not np.isnan(tie.misclosure):
        words = (
            f"misclosure {tie.misclosure:+.3f} +- {tie.misclosure_uncertainty:.3f} mGal, "
            f"record at {100.0 * tie.fraction:.0f} % of the way"
        )
    return Change(gravity * float(tie.period[1] / case.period) ** 2, sigma, words)


def _by_number(
    name: str, formula: str, source: str, need: str, after: Callable[[Case, float, float], float], words: str
) -> Correction:
    """A correction by one number of /instrument: `words` may hold it, {x}, its root, {rms}, or {mrad}."""

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
