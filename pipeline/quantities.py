"""The paper's quantities, whichever method gave gravity: phases and their speeds, corrections, residual, ship.

All come from the same separated harmonics. A stored speed is the derivative of the stored phase by central differences
(`numpy.gradient`), so that its mean under the parabola of a slope fit is the slope of that phase.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.arrays import Complexes, Floats, unwrapped
from pipeline.correction import NON_ISOCHRONISM, PARTS, by_periods, of_real_pendulums
from pipeline.harmonics.envelope import HOP_SECONDS
from pipeline.methods import BEST_FIRST
from pipeline.methods.phases import LEAST_AMPLITUDE
from pipeline.phase_speed import amplitude_rate, phase_speed, speed_of_difference
from pipeline.prepared import Prepared
from pipeline.reduction import Reduction

FORMULAS = ("(9)", "(9) as practised", "(27)", "(36)", "(38)")
"""Labels of Panteleev's formulas for the phase speed; (9) is that of the fictitious pendulum."""
GAP, INTERPOLATED, AMBIGUOUS = 1, 4, 16  # of the quality flags
TAPS = 9  # of a derivative
SPARSE = 0.8  # rad of the swing between samples, from which a polynomial through nine of them is none
SPECTRUM = 1024  # samples a segment


def best_of(reductions: Sequence[Reduction]) -> Reduction | None:
    """The most exact method that gave a value."""
    given, order = [each for each in reductions if each.estimate is not None], list(BEST_FIRST)
    return min(given, key=lambda each: order.index(each.method) if each.method in order else 99, default=None)


@np.errstate(invalid="ignore", divide="ignore")
def phases(prepared: Prepared, reductions: Sequence[Reduction], known: Floats) -> dict[str, Any]:
    """Group `phases`: amplitudes and phases of both pendulums and their difference, and the formulas' phase speeds.

    `known` (n,) are times of the difference's samples, s from the first that is used.
    """
    envelope, seen, best = prepared.sliding, prepared.observation, best_of(reductions)
    time, difference = envelope.time, envelope.difference
    harmonics = np.stack([envelope.first, envelope.first - difference, difference])
    amplitude, phase = np.abs(harmonics), unwrapped(harmonics) + envelope.carrier * time
    noise, frequency = np.array([prepared.noise_theta, prepared.noise_difference]), prepared.nominal
    gamma, real = 0.0, True
    if best is not None and best.estimate is not None:
        noise[np.isnan(noise)] = best.estimate.noise
        frequency, gamma = best.estimate.frequency, best.estimate.damping_rate
        real = best.estimate.acceleration_reduced or best.method != "joint"
    real = real and seen.restoring != "linear"
    one, apart = seen.frequency_ratio * frequency, seen.damping_difference
    own = np.array([1.0, frequency / one]) * one
    sigma = np.sqrt(envelope.noise_gain) * np.array([noise[0], np.hypot(*noise), noise[1]])
    lead = np.angle(envelope.share)
    raw = _raw(prepared, own)
    fictitious = raw[0] - seen.frequency_ratio * raw[1]
    turned = difference * np.exp(1j * envelope.carrier * time)
    speeds = own[:, None] * (1.0 - real * amplitude[:2] ** 2 / 16.0)
    growth = -np.array([[gamma + apart], [gamma]]) * amplitude[:2]
    return {
        "amplitude": amplitude,
        "amplitude_sigma": sigma,
        "phase": phase,
        "phase_sigma": sigma[:, None] / amplitude,
        "phase_speed": np.gradient(phase, time, axis=1),
        "slow": np.stack([envelope.slow[0], envelope.slow[0] - envelope.slow[1], envelope.slow[1]]),
        "phase_qc": _quality(amplitude, time, known),
        "fictitious_amplitude": np.abs(fictitious),
        "fictitious_phase": unwrapped((fictitious * np.exp(-1j * envelope.carrier * time))[None])[0]
        + envelope.carrier * time,
        "phase_speed_by_formula": np.stack(
            [
                phase_speed(one, frequency, np.abs(raw[0]), np.abs(fictitious), np.angle(raw[0] / fictitious), apart),
                phase_speed(one, frequency, np.abs(raw[0]), amplitude[2], np.angle(raw[0] / turned)),
                phase_speed(one, frequency, amplitude[0], amplitude[2], lead, apart),
                speed_of_difference(amplitude[:2], phase[0] - phase[1], speeds, growth),
                phase_speed(speeds[0], speeds[1], amplitude[0], amplitude[2], phase[0] - phase[2], apart),
            ]
        ),
        "amplitude_rate": np.gradient(amplitude[2], time),
        "amplitude_rate_by_27": amplitude_rate(one - frequency, amplitude[0], amplitude[2], lead, gamma, apart),
    }


def _raw(prepared: Prepared, own: Floats) -> Complexes:
    """`theta_i - i theta_i'/n_i` of both pendulums, slow motion and all, (2, k)."""
    envelope, seen = prepared.sliding, prepared.observation
    if seen.step * prepared.nominal > SPARSE:  # samples do not show a derivative: that of swing and slow motion
        harmonics, speeds = (
            np.stack([a, a - b])
            for a, b in ((envelope.first, envelope.difference), (envelope.first_speed, envelope.difference_speed))
        )
        turn = np.exp(1j * envelope.carrier * envelope.time)
        slow = np.stack([envelope.slow[0], envelope.slow[0] - envelope.slow[1]])
        value = (harmonics * turn).real + slow
        slope = ((speeds + 1j * envelope.carrier * harmonics) * turn).real + np.gradient(slow, envelope.time, axis=1)
    else:
        at = np.rint(envelope.time / seen.step).astype(np.int64)[:, None] + np.arange(TAPS) - TAPS // 2
        powers = np.vander(np.arange(TAPS) - TAPS // 2, increasing=True).T  # what x^k is at the nine, row by row
        taps = np.linalg.solve(powers, np.eye(TAPS)[1]) / seen.step
        series = np.stack([seen.theta, seen.theta - seen.difference])[:, at]
        value, slope = series[:, :, TAPS // 2], series @ taps
    return np.asarray(value - 1j * slope / own[:, None])


def _quality(amplitude: Floats, time: Floats, known: Floats) -> np.ndarray:
    """Flags (3, k): no phase; no reading within a hop; an amplitude so small that its phase says nothing."""
    qc = np.where(np.isnan(amplitude), GAP, 0)
    with np.errstate(invalid="ignore"):
        qc |= np.where(amplitude < LEAST_AMPLITUDE * np.fmax.reduce(amplitude, axis=1, keepdims=True), AMBIGUOUS, 0)
    if known.size:
        near = np.clip(np.searchsorted(known, time), 1, known.size - 1) if known.size > 1 else np.zeros(1, dtype=int)
        away = np.minimum(np.abs(known[near] - time), np.abs(known[near - 1] - time))
        qc |= np.where(away > HOP_SECONDS, INTERPOLATED, 0)
    return qc.astype(np.uint16)


@np.errstate(invalid="ignore", divide="ignore")
def correction(prepared: Prepared, reductions: Sequence[Reduction], own: Prepared | None = None) -> dict[str, Any]:
    """Group `correction`: what each method adds to the difference's phase; `own`: what others than joint looked at."""
    envelope = prepared.sliding
    time = envelope.time
    measured = unwrapped(envelope.difference[None])[0] + envelope.carrier * time
    shape = len(reductions), time.size
    parts = {name: np.full(shape, np.nan) for name in PARTS}
    corrected, gravity = np.full(shape, np.nan), np.full(shape, np.nan)
    for row, each in enumerate(reductions):
        if each.estimate is None or each.gravity is None:
            continue
        shifts = _shifts(prepared, each, own)
        for name, values in parts.items():
            values[row] = -shifts.get(name, 0.0)
        corrected[row] = np.gradient(measured - sum(shifts.values()), time)
        whole = np.hypot(corrected[row], each.estimate.damping_rate)
        gravity[row] = each.gravity.gravity * (whole / each.estimate.frequency) ** 2
    total = sum(parts.values())
    return {
        **{name: np.gradient(values, time, axis=1) for name, values in parts.items()},
        "phase_speed_correction": np.gradient(total, time, axis=1),
        "phase_correction": total,
        "corrected_phase_speed": corrected,
        "corrected_gravity": gravity,
    }


def _shifts(prepared: Prepared, reduction: Reduction, own: Prepared | None) -> Mapping[str, Floats]:
    """Phases that a method takes off; of one that finds the frequency otherwise, what its frequency makes of them."""
    estimate = reduction.estimate
    assert estimate is not None
    if estimate.shifts is None and estimate.acceleration_reduced:
        return of_real_pendulums(prepared, estimate.frequency)
    if estimate.shifts is None:
        return {NON_ISOCHRONISM: by_periods(prepared, estimate.frequency)}
    if own is None:
        return estimate.shifts
    from scipy.interpolate import CubicSpline

    there = own.sliding.time + own.observation.start - prepared.observation.start
    time = np.clip(prepared.sliding.time, there[0], there[-1])
    return {name: CubicSpline(there, values)(time) for name, values in estimate.shifts.items()}


def model_of_harmonics(prepared: Prepared, time: Floats) -> Floats:
    """Difference as its harmonic and slow part have it at times from the first sample that is used, s; else NaN."""
    envelope = prepared.sliding
    swing = np.interp(time, envelope.time, envelope.difference) * np.exp(1j * envelope.carrier * time)
    slow = np.interp(time, envelope.time, envelope.slow[1], left=np.nan, right=np.nan)
    return np.asarray(swing.real + slow)


def spectrum(time: Floats, residual: Floats) -> tuple[dict[str, Any], dict[str, Any]]:
    """Group `spectrum`: power spectral density of a residual, one-sided, rad2 s, by Welch's method; samples that are
    not there are zeros, made up for by their share."""
    step = float(np.median(np.diff(time)))
    row = np.rint((time - time[0]) / step).astype(np.int64)
    laid, there, good = np.zeros(int(row[-1]) + 1), np.zeros(int(row[-1]) + 1, dtype=bool), np.isfinite(residual)
    laid[row], there[row] = np.where(good, residual - (residual[good].mean() if good.any() else 0.0), 0.0), good
    size = min(SPECTRUM, laid.size)
    taper = np.hanning(size + 1)[:size]
    segments, present = (sliding_window_view(each, size)[:: max(1, size // 2)] for each in (laid, there))
    power = np.sum(np.abs(np.fft.rfft(taper * segments)) ** 2, axis=0)
    weight = float(present.sum(axis=0) @ taper**2)
    density = 2.0 * step * power / max(weight, 1e-300)
    return {"residual_spectrum": density}, {"frequency": np.fft.rfftfreq(size, step)}
