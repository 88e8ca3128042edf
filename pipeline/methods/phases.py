"""What the methods that correct a phase have in common: the phase, its weights, the regression, the error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.estimate import Estimate
from pipeline.harmonics.envelope import Envelope
from pipeline.harmonics.narrowband import running_integral
from pipeline.prepared import LEAST_EXPLAINED, MOST_ANGLE, Prepared, require_swing

LEAST_AMPLITUDE = 0.1  # min a / max a below which the phase form of (27) errs by up to 1000 mGal


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


def integrate(speed: Floats, hop: float) -> Floats:
    """Integrated correction."""
    return np.asarray(running_integral(speed.astype(np.complex128), hop).real)


def corrected(
    prepared: Prepared,
    found: Phases,
    speed: Floats | None,
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
    envelope = found.envelope
    present = found.weight > 0.0
    time = envelope.time[present]
    weight = found.weight[present]

    lever = weight * (time - (weight @ time) / weight.sum())
    lever /= lever @ time  # what each phase does to the slope of the weighted straight line
    plain = float(lever @ found.phase[present])
    shift = None if speed is None else integrate(speed, envelope.hop)
    if shift is not None and gained is not None:
        shift = shift + gained
    residual = (found.phase if shift is None else found.phase - shift)[present]
    slant = float(lever @ residual)
    oscillation = envelope.carrier + slant
    arc = 0.0 if finite_arc is None else float(lever @ integrate(finite_arc, envelope.hop)[present])
    gamma = prepared.fine.damping_rate
    residual = residual - slant * time
    residual = residual - (weight @ residual) / weight.sum()
    size = envelope.difference[present]
    scatter = np.full(envelope.time.size, np.nan)
    scatter[present] = 2.0 * np.square(residual) * (size.real**2 + size.imag**2)  # quadrature alone: twice
    quadrature = component_variance(scatter, envelope)
    return with_noise(
        prepared,
        envelope,
        quadrature,
        frequency=float(np.hypot(oscillation, gamma)),
        uncorrected=float(np.hypot(envelope.carrier + plain, gamma)),
        damping_rate=gamma,
        phase_correction=shift,
        speed_correction=speed,
        finite_arc=-arc,
        acceleration_reduced=gained is not None,
    )


WHOLE = 0.97  # coverage from which a window's noise is that of a complete one
LEAST_WHOLE = 30


def component_variance(squares: Floats, envelope: Envelope) -> float:
    """Mean square of one component from |residual|^2, over complete windows where there are enough of them."""
    whole = np.isfinite(squares) & (envelope.coverage >= WHOLE)
    chosen = whole if whole.sum() >= LEAST_WHOLE else np.isfinite(squares)
    return 0.5 * float(np.mean(squares[chosen]))


def with_noise(prepared: Prepared, envelope: Envelope, variance: float, **found: Any) -> Estimate:
    """Complete an estimate with its error budget.

    Parameters
    ----------
    variance : float
        Mean square of one component of the envelope's residual, rad2.
    """
    noise = prepared.noise_difference
    if not np.isfinite(noise):
        noise = float(np.sqrt(variance / envelope.noise_gain))
    colour = variance / (noise**2 * envelope.noise_gain) if noise > 0.0 else 1.0
    shared = prepared.fine_budget
    gain = shared.noise_difference
    step = prepared.observation.step
    difference = prepared.observation.difference
    if step * prepared.nominal > MOST_ANGLE:
        influence = envelope.influence(shared.influence, difference.size, round(envelope.hop / step))
        gain = float(np.sqrt(np.sum(influence[np.isfinite(difference)] ** 2)))
    return Estimate(
        sigma=float(
            np.hypot(gain * noise * np.sqrt(max(colour, 1.0)), prepared.theta_error(shared.noise_theta, noise))
        ),
        noise=noise,
        samples=int(np.isfinite(difference).sum()),
        residual_colour=colour,
        **found,
    )
