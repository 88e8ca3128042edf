"""Methods on separated harmonics: the phase of the difference, corrected, and its slope.

`uncorrected` takes the slope as if the two pendulums were isochronous, `vening-meinesz` corrects by (9), `panteleev` by
(27), `general` by (38) fed with the model's `phi_i' = n_i (1 - Theta_i^2/16)` and `a_i' = -gamma_i a_i` (with measured
speeds that identity only returns the measured phase); `complex` fits the complex form of (27), which has no singularity
where the amplitude passes through zero. A correction is integrated and subtracted before the regression: averaging it
and subtracting it from a slope would be wrong by up to 97 mGal, because the two weigh time differently.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.correction import ACCELERATION, ARC, NON_ISOCHRONISM, by_periods, integrated, of_real_pendulums
from pipeline.harmonics.envelope import Envelope
from pipeline.harmonics.narrowband import regression
from pipeline.phase_speed import phase_speed
from pipeline.prepared import LEAST_EXPLAINED, MOST_ANGLE, Estimate, Prepared, require_swing

LEAST_AMPLITUDE = 0.1  # min a / max a below which the phase form of (27) errs by up to 1000 mGal
WHOLE = 0.97  # coverage from which a window's noise is that of a complete one
LEAST_WHOLE = 30
MARK_SECONDS = 60.0
IDENTICAL = 1e-9  # of n1/n2
_NEIGHBOURS = 9
ROUNDS = 2  # the acceleration's phase turns with n2, which it shifts by 1e-3 at most
INEXACT = 2e-3  # of what horizontal and vertical acceleration do: they act slowly but for that
DENIED = 0.5  # residual power by one law over that by the other, below which the record denies this


@dataclass(frozen=True)
class Phases:
    """Phase of the difference relative to the carrier, and the separated harmonics it came from."""

    envelope: Envelope
    phase: Floats  # (k,) phi less carrier times time, rad
    weight: Floats  # (k,) a^2 times coverage: the phase's variance goes as 1/a^2


def phases(prepared: Prepared, *, through_zero: bool = False) -> Phases:
    """Phase of the difference.

    `RefusedError`: gaps are longer than a window, no swing near the nominal period explains it, or the amplitude
    passes so near zero that its phase means nothing (unless `through_zero`).
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
    """Correct by (27) with the damping difference; it needs n2 to the relative size of n1-n2 only."""
    return corrected(prepared, phases(prepared), {NON_ISOCHRONISM: by_periods(prepared, prepared.fine.frequency)})


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


def vening_meinesz(prepared: Prepared) -> Estimate:
    """Read (9) at minute marks with the raw first pendulum, join the readings by straight lines, integrate and regress.

    It is the method of the 1930s and keeps its fault: the slow motion psi1 leaks into a1 and phi1 as (14) shows.
    `RefusedError` also where the pendulums are identical: no fictitious one is to be formed of them, (3).
    """
    if abs(prepared.observation.frequency_ratio - 1.0) < IDENTICAL:
        raise RefusedError(
            "instrument/period: both pendulums have the same period: the fictitious pendulum is the difference itself; "
            "use the method uncorrected, or joint"
        )
    found = phases(prepared)
    envelope, seen, frequency = found.envelope, prepared.observation, prepared.fine.frequency
    marks = np.arange(0, envelope.time.size, max(1, round(MARK_SECONDS / envelope.hop)))
    time, first_frequency = envelope.time[marks], seen.frequency_ratio * frequency
    value, slope = value_and_slope(seen.time, seen.theta, time)
    raw = value - 1j * slope / first_frequency  # (4)
    difference = envelope.difference[marks] * np.exp(1j * envelope.carrier * time)
    reading = phase_speed(first_frequency, frequency, np.abs(raw), np.abs(difference), np.angle(raw / difference))
    speed = np.interp(envelope.time, time, reading - frequency)
    return corrected(prepared, found, {NON_ISOCHRONISM: integrated(speed, envelope.hop)})


def value_and_slope(time: Floats, series: Floats, instants: Floats) -> tuple[Floats, Floats]:
    """Elongation and its derivative at given instants, by the polynomial through the nine nearest samples."""
    present = np.isfinite(series)
    time, series = time[present], series[present]
    start = np.clip(np.searchsorted(time, instants) - _NEIGHBOURS // 2, 0, time.size - _NEIGHBOURS)
    value, slope = np.empty(instants.size), np.empty(instants.size)
    for k, instant in enumerate(instants):
        part = slice(start[k], start[k] + _NEIGHBOURS)
        fit = np.polynomial.Polynomial.fit(time[part] - instant, series[part], _NEIGHBOURS - 1)
        value[k], slope[k] = fit(0.0), fit.deriv()(0.0)
    return value, slope


def general(prepared: Prepared) -> Estimate:
    """Correct by (38) with model speeds, arcs and the support's acceleration as they act on real pendulums.

    Of linear pendulums, which feel neither, (27) is left where the record says `restoring = linear`. Where it states
    no law and the residual denies the acceleration, that is left out and sigma holds the arcs; where the residual is
    alike by both laws, sigma holds both.
    """
    found = phases(prepared)
    envelope, restoring, frequency = found.envelope, prepared.observation.restoring, prepared.fine.frequency
    linear = corrected(prepared, found, {NON_ISOCHRONISM: by_periods(prepared, frequency)})
    if restoring == "linear":
        return linear
    slow = prepared.slow_motion
    told = (envelope.time >= slow.time[0]) & (envelope.time <= slow.time[-1])
    found = replace(found, weight=np.where(told, found.weight, 0.0))
    for _ in range(ROUNDS):
        made = corrected(prepared, found, of_real_pendulums(prepared, frequency))
        frequency = made.frequency
    motions = (replace(slow, zeta=None), slow)
    level, both = (regression(envelope.time, each.phase(frequency, envelope.time), found.weight) for each in motions)
    made = replace(made, sigma=float(np.hypot(made.sigma, INEXACT * (abs(level) + abs(both - level)))))
    if restoring is not None:
        return made
    power, powers = (each.noise**2 * each.residual_colour for each in (linear, made))
    if power < DENIED * powers:
        real = of_real_pendulums(prepared, prepared.fine.frequency)
        made = corrected(prepared, found, {name: shift for name, shift in real.items() if name != ACCELERATION})
    elif powers < DENIED * power:
        return made
    return replace(made, sigma=float(np.hypot(made.sigma, made.frequency - linear.frequency)))


def corrected(prepared: Prepared, found: Phases, shifts: Mapping[str, Floats]) -> Estimate:
    """Take integrated corrections, (k,) rad by `correction.PARTS`, off the phase, and regress."""
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

    `squares` (k,) are |residual|^2 of the envelope, rad2, NaN = not used; `oscillation` is the damped n2 and
    `uncorrected_slope` that of the phase before any correction, less the carrier, rad s-1.
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
        sigma=float(np.hypot(own, prepared.theta_error(shared.noise_theta, noise))), noise=noise, damping_rate=gamma,
        samples=int(known.sum()), residual_colour=colour, **others,
    )  # fmt: skip
