"""Methods on separated harmonics: the phase of the difference, corrected, and its slope.

`uncorrected` takes the slope as if the two pendulums were isochronous, `panteleev` corrects by (27), `complex` fits the
complex form of (27), which has no singularity where the amplitude passes through zero. A correction is integrated and
subtracted before the regression: averaging it and subtracting it from a slope would be wrong by up to 97 mGal, because
the two weigh time differently.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.correction import ACCELERATION, ARC, NON_ISOCHRONISM, by_periods
from pipeline.estimate import Estimate
from pipeline.harmonics.envelope import Envelope
from pipeline.harmonics.narrowband import regression
from pipeline.prepared import LEAST_EXPLAINED, MOST_ANGLE, Prepared, require_swing

LEAST_AMPLITUDE = 0.1  # min a / max a below which the phase form of (27) errs by up to 1000 mGal
WHOLE = 0.97  # coverage from which a window's noise is that of a complete one
LEAST_WHOLE = 30


@dataclass(frozen=True)
class Phases:
    """Phase of the difference relative to the carrier, and the separated harmonics it came from."""

    envelope: Envelope
    phase: Floats
    """(k,) phi less carrier times time, rad."""
    weight: Floats
    """(k,) a^2 times coverage: the phase's variance goes as 1/a^2."""


def phases(prepared: Prepared, *, through_zero: bool = False) -> Phases:
    """Phase of the difference.

    Raises
    ------
    RefusedError
        Gaps are longer than a window, or the amplitude passes so near zero that its phase means nothing (unless
        `through_zero`).
    """
    envelope = prepared.sliding
    require_swing(envelope)
    amplitude = np.abs(envelope.difference)
    missing = int((np.isnan(amplitude) | np.isnan(envelope.first)).sum())
    if missing:
        raise RefusedError(
            f"record/elongation: gaps leave the swing unknown at {missing} of {amplitude.size} instants; "
            "use --method joint"
        )
    if prepared.fine_explained < LEAST_EXPLAINED:
        raise RefusedError(
            "difference: a swing at the nominal period does not explain it; check instrument/period and that the trace "
            "is a difference of two pendulums"
        )
    if not through_zero and passes_zero(amplitude):
        raise RefusedError(
            "difference: its amplitude falls below a tenth of its maximum, where a phase means nothing; "
            "use the method 'complex' or 'projection'"
        )
    return Phases(envelope, np.unwrap(np.angle(envelope.difference)), envelope.coverage * amplitude**2)


def passes_zero(amplitude: Floats) -> bool:
    """Whether the amplitude comes so near zero that the phase form of (27) means nothing."""
    present = amplitude[np.isfinite(amplitude)]
    return bool(present.size and present.min() < LEAST_AMPLITUDE * present.max())


def uncorrected(prepared: Prepared) -> Estimate:
    """Regress the phase of the difference without any correction."""
    return corrected(prepared, phases(prepared), {})


def panteleev(prepared: Prepared) -> Estimate:
    """Correct by (27) with the damping difference."""
    found = phases(prepared)
    # the correction needs n2 to the relative size of n1-n2 only
    return corrected(prepared, found, {NON_ISOCHRONISM: by_periods(prepared, prepared.fine.frequency)})


def complex_form(prepared: Prepared) -> Estimate:
    """Least squares for n2 with n1/n2 held."""
    found = phases(prepared, through_zero=True)
    envelope, fit = found.envelope, prepared.fine
    return with_noise(
        prepared,
        np.abs(envelope.difference - fit.model) ** 2,
        fit.frequency,
        regression(envelope.time, found.phase, found.weight),
        shifts={NON_ISOCHRONISM: by_periods(prepared, fit.frequency)},
    )


def corrected(prepared: Prepared, found: Phases, shifts: Mapping[str, Floats]) -> Estimate:
    """Take integrated corrections off the phase, and regress.

    Parameters
    ----------
    shifts : mapping
        By `correction.PARTS`: (k,) rad.
    """
    envelope, weight, time = found.envelope, found.weight, found.envelope.time
    residual = found.phase - sum(shifts.values())
    slope = regression(time, residual, weight)
    residual = residual - slope * time
    residual -= np.average(residual, weights=weight)
    scatter = 2.0 * np.square(residual * np.abs(envelope.difference))  # quadrature alone: twice
    return with_noise(
        prepared,
        np.where(weight > 0.0, scatter, np.nan),
        envelope.carrier + slope,
        regression(time, found.phase, weight),
        shifts=shifts,
        finite_arc=-regression(time, shifts[ARC], weight) if ARC in shifts else 0.0,
        acceleration_reduced=ACCELERATION in shifts,
    )


def with_noise(
    prepared: Prepared, squares: Floats, oscillation: float, uncorrected_slope: float, **others: Any
) -> Estimate:
    """An estimate with its error budget.

    Parameters
    ----------
    squares : (k,) array
        |residual|^2 of the envelope, rad2, NaN = not used.
    oscillation, uncorrected_slope : float
        Damped n2; slope of the phase before any correction, less the carrier, rad s-1.
    """
    envelope, gamma, shared = prepared.sliding, prepared.fine.damping_rate, prepared.fine_budget
    whole = np.isfinite(squares) & (envelope.coverage >= WHOLE)
    # complete windows where there are enough of them; of both components one
    variance = 0.5 * float(np.mean(squares[whole if whole.sum() >= LEAST_WHOLE else np.isfinite(squares)]))
    noise = prepared.noise_difference
    if not np.isfinite(noise):
        noise = float(np.sqrt(variance / envelope.noise_gain))
    colour = variance / (noise**2 * envelope.noise_gain) if noise > 0.0 else 1.0
    step, known = prepared.observation.step, np.isfinite(prepared.observation.difference)
    gain = shared.noise_difference
    if step * prepared.nominal > MOST_ANGLE:
        influence = envelope.influence(shared.influence, known.size, round(envelope.hop / step))
        gain = float(np.linalg.norm(influence[known]))
    own = gain * noise * np.sqrt(max(colour, 1.0))
    return Estimate(
        frequency=float(np.hypot(oscillation, gamma)),
        uncorrected=float(np.hypot(envelope.carrier + uncorrected_slope, gamma)),
        sigma=float(np.hypot(own, prepared.theta_error(shared.noise_theta, noise))),
        noise=noise,
        damping_rate=gamma,
        samples=int(known.sum()),
        residual_colour=colour,
        **others,
    )
