"""From the frequency of the second pendulum to gravity, its uncertainty, its ledger and its sensitivities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.estimate import Budget, Estimate
from pipeline.observation import Observation

MGAL = 1e-5  # m s-2
DAY = 86400.0  # s


@dataclass(frozen=True)
class Entry:
    """One correction, ADDED to gravity; mGal."""

    value: float
    sigma: float
    applied: bool
    reason: str


@dataclass(frozen=True)
class Gravity:
    """Gravity of one method.

    Attributes
    ----------
    gravity : float
        m s-2.
    sigma : float
        1-sigma, mGal: reading noise, uncertainty of the periods and of the gain.
    frequency : (2,) tuple
        n1, n2 in true time, rad s-1.
    frequency_sigma : float
        Of n2 from reading noise alone, rad s-1.
    ledger : dict
        Name to `Entry`; the applied values add up to gravity less the uncorrected gravity.
    per_ratio, per_gain : float
        Change of gravity, mGal, for n1/n2 larger by 1e-7, and for a gain of the first pendulum's trace larger by 1 %.
    """

    gravity: float
    sigma: float
    frequency: tuple[float, float]
    frequency_sigma: float
    ledger: dict[str, Entry]
    per_ratio: float
    per_gain: float


def gravity(estimate: Estimate, seen: Observation, budget: Budget, gain_uncertainty: float = 0.0) -> Gravity:
    """`g = g_ref (n/n_ref)^2` of the second pendulum, with everything that is known of its error.

    Parameters
    ----------
    gain_uncertainty : float
        Relative 1-sigma uncertainty of the first pendulum's scale against the difference's.
    """
    reference = float(seen.frequency_reference[1])
    clock = 1.0 + seen.chronometer_rate / DAY  # T_true = T clock

    def at(frequency: float, clock: float = 1.0) -> float:
        return seen.reference_gravity * (frequency / (clock * reference)) ** 2

    value = at(estimate.frequency, clock)
    scale = 2.0 * value / estimate.frequency / MGAL  # mGal per rad s-1
    u1, u2 = seen.period_relative_uncertainty
    ratio_share = scale * budget.by_ratio * seen.frequency_ratio
    # a relative error of T1 lowers n1/n2; one of T2 raises it and lowers the reference frequency
    periods = np.hypot(ratio_share * u1, (ratio_share + 2.0 * value / MGAL) * u2)
    gain = scale * budget.by_gain * gain_uncertainty
    noise = scale * estimate.sigma
    plain, corrected, unbent = (at(f) for f in (estimate.uncorrected, estimate.frequency, _unbent(estimate)))
    known = seen.damping_rate is not None
    ledger = {
        "non_isochronism": Entry(
            (unbent - plain) / MGAL,
            float(np.hypot(np.hypot(ratio_share * u1, ratio_share * u2), gain)),
            unbent != plain,
            "n1/n2 from instrument/period; damping difference "
            + ("stated" if known else "taken as zero, none is stated"),
        ),
        "finite_arc": Entry(
            (corrected - unbent) / MGAL,
            0.0,
            estimate.finite_arc != 0.0,
            "arc of both pendulums"
            if estimate.finite_arc != 0.0
            else "the method has no arc terms, or restoring = linear",
        ),
        "chronometer": Entry(
            (value - corrected) / MGAL,
            0.0,
            clock != 1.0,
            "instrument/chronometer_rate" if clock != 1.0 else "instrument/chronometer_rate: none stated",
        ),
    }
    return Gravity(
        gravity=value,
        sigma=float(np.sqrt(noise**2 + periods**2 + gain**2)),
        frequency=(estimate.frequency * seen.frequency_ratio / clock, estimate.frequency / clock),
        frequency_sigma=estimate.sigma,
        ledger=ledger,
        per_ratio=scale * budget.by_ratio * 1e-7,
        per_gain=scale * budget.by_gain * 1e-2,
    )


def _unbent(estimate: Estimate) -> float:
    """Frequency without the finite-arc part of the correction."""
    return estimate.frequency - estimate.finite_arc
