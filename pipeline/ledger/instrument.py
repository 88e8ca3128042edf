"""Corrections for clock and instrument: chronometer, temperature, air, base stations, flexure of the support."""

from __future__ import annotations

import numpy as np

from pipeline.conditions import AIR, BASE, TEMPERATURE, by_temperature
from pipeline.ledger.entry import DAY, MGAL, Case, Change, absent, correction

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
    """Compare with the period that the instrument has at the record's temperature: a warm pendulum is longer.

    A temperature that changes within the record counts as it acts on the fitted frequency.
    """
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
    """Reduce to vacuum, where instrument/period holds: air bears a part of the pendulum and is carried along by it.

    The air's part is compared with the period that temperature has left, as both add to it.
    """
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
