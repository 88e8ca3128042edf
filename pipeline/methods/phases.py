"""Methods on separated harmonics: the phase of the difference, corrected, and its slope.

`uncorrected` takes the slope as if the two pendulums were isochronous, `panteleev` corrects by (27), `complex` fits the
complex form of (27), which has no singularity where the amplitude passes through zero. A correction is integrated and
subtracted before the regression: averaging it and subtracting it from a slope would be wrong by up to 97 mGal, because
the two weigh time differently.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.estimate import Estimate
from pipeline.harmonics.envelope import Envelope
from pipeline.harmonics.narrowband import regression, running_integral
from pipeline.phase_speed import phase_speed
from pipeline.prepared import LEAST_EXPLAINED, MOST_ANGLE, Prepared, require_swing

LEAST_AMPLITUDE = 0.1  # min a / max a below which the phase form of (27) errs by up to 1000 mGal
WHOLE = 0.97  # coverage from which a window's noise is that of a complete one
LEAST_WHOLE = 30


@dataclass(frozen=True)
class Phases:
    """Phase of the difference relative to the carrier, and the separated harmonics it came from.

    Attributes
    ----------
    envelope : Envelope
    phase : (k,) array
        phi less carrier times time, rad.
    weight : (k,) array
        a^2 times coverage: the phase's variance goes as 1/a^2.
    """

    envelope: Envelope
    phase: Floats
    weight: Floats


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
    return corrected(prepared, phases(prepared))


def panteleev(prepared: Prepared) -> Estimate:
    """Correct by (27) with the damping difference."""
    found = phases(prepared)
    share, seen = found.envelope.share, prepared.observation
    frequency = prepared.fine.frequency  # the correction needs n2 to the relative size of n1-n2 only
    speed = phase_speed(
        seen.frequency_ratio * frequency, frequency, np.abs(share), 1.0, np.angle(share), seen.damping_difference
    )
    return corrected(prepared, found, speed - frequency)


def complex_form(prepared: Prepared) -> Estimate:
    """Least squares for n2 with n1/n2 held."""
    found = phases(prepared, through_zero=True)
    envelope, seen, fit = found.envelope, prepared.observation, prepared.fine
    speed = None
    if not passes_zero(np.abs(envelope.difference)):
        kappa = 1j * fit.frequency * (seen.frequency_ratio - 1.0) - seen.damping_difference
        speed = (kappa * envelope.share).imag
    return with_noise(
        prepared,
        np.abs(envelope.difference - fit.model) ** 2,
        fit.frequency,
        regression(envelope.time, found.phase, found.weight),
        speed_correction=speed,
        phase_correction=None if speed is None else integrate(speed, envelope.hop),
    )


def integrate(speed: Floats, hop: float) -> Floats:
    """Integrated correction."""
    return np.asarray(running_integral(speed.astype(np.complex128), hop).real)


def corrected(
    prepared: Prepared,
    found: Phases,
    speed: Floats | None = None,
    finite_arc: Floats | None = None,
    gained: Floats | None = None,
) -> Estimate:
    """Integrate the correction, subtract it from the phase, regress.

    Parameters
    ----------
    speed : (k,) array or None
        Correction of the phase speed, rad s-1 (subtracted).
    finite_arc : (k,) array or None
        The part of `speed` that is due to the finite arc.
    gained : (k,) array or None
        Phase that the support's acceleration gives the swing, rad (subtracted).
    """
    envelope, weight = found.envelope, found.weight
    time, hop = envelope.time, envelope.hop

    shift = None if speed is None else integrate(speed, hop) + (0.0 if gained is None else gained)
    residual = found.phase if shift is None else found.phase - shift
    slope = regression(time, residual, weight)
    residual = residual - slope * time
    residual -= np.average(residual, weights=weight)
    scatter = 2.0 * np.square(residual * np.abs(envelope.difference))  # quadrature alone: twice
    return with_noise(
        prepared,
        np.where(weight > 0.0, scatter, np.nan),
        envelope.carrier + slope,
        regression(time, found.phase, weight),
        phase_correction=shift,
        speed_correction=speed,
        finite_arc=0.0 if finite_arc is None else -regression(time, integrate(finite_arc, hop), weight),
        acceleration_reduced=gained is not None,
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
