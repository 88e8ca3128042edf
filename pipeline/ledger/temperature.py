"""A warm pendulum is longer."""

from __future__ import annotations

from pipeline.conditions import TEMPERATURE
from pipeline.ledger.entry import Case, Change

NAME = "temperature"
FORMULA = "T_ref = T - c (t - t_ref), c = expansion coefficient times T/2"
SOURCE = "calibrated coefficient; Vening Meinesz 1929, Theory and Practice of Pendulum Observations at Sea"
NEEDS = TEMPERATURE
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Compare with the period that the instrument has at the record's temperature.

    A temperature that changes within the record counts as it acts on the fitted frequency.
    """
    constants = case.prepared.observation.constants
    warm = case.scalar("temperature") - case.scalar("temperature_reference")
    told = f"{case.scalar('temperature'):.2f} K"
    if "temperature_course" in constants:
        course = case.pair("temperature_course")
        warm = case.mean_over_record(course) - case.scalar("temperature_reference")
        low, high = float(course.min()), float(course.max())
        told = f"{low:.2f} to {high:.2f} K, acting as {warm + case.scalar('temperature_reference'):.3f} K"
    period = case.period
    after = gravity * (1.0 + case.pair("temperature_coefficient")[1] * warm / period) ** 2
    sigma = case.sigma(common=_common(case), coefficients=_coefficients(case, warm))
    return Change(after, sigma, f"{told}, {warm:+.2f} K from the reference")


def _common(case: Case) -> float | None:
    """Of a thermometer that both pendulums share, mGal."""
    own = case.uncertainty("temperature")
    if own is None:
        return None
    longer = case.pair("temperature_coefficient") * own / case.period
    return case.of_periods(longer[0], longer[1])


def _coefficients(case: Case, warm: float) -> float | None:
    own = case.uncertainties("temperature_coefficient")
    return None if own is None else case.independent(own * warm / case.period)
