"""The envelope between half-second marks: its narrow band of equations against the same least squares written out."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.projection import missing_marks, upsample
from pipeline.projection.sampling import FEW_A_SWING


def test_the_narrow_band_is_the_whole_matrix() -> None:
    random = np.random.default_rng(4)
    time = np.sort(random.choice(0.5 * np.arange(500), 430, replace=False))
    swing = random.normal(size=time.size)
    knots = upsample.KNOT_SECONDS * np.arange(-1.0, 26.0)  # the last reading's splines reach beyond them
    frequency = 5.1
    basis = upsample._cubic((time[:, None] - knots) / upsample.KNOT_SECONDS)
    carrier = np.exp(1j * frequency * time)
    matrix = np.hstack([basis * carrier.real[:, None], -basis * carrier.imag[:, None]])
    bend = np.diff(np.eye(knots.size), 2, axis=0)
    rate = time.size / knots.size
    penalty = upsample.STIFFNESS * rate / (0.1 * upsample.KNOT_SECONDS) ** 4 * (bend.T @ bend)
    penalty += 1e-9 * rate * np.eye(knots.size)
    normal = matrix.T @ matrix + np.kron(np.eye(2), penalty)
    real, imaginary = np.linalg.solve(normal, matrix.T @ swing).reshape(2, -1)
    assert upsample._segment(time, swing, knots, frequency) == pytest.approx(real + 1j * imaginary, abs=1e-9)


def test_missing_marks_are_guessed_from_those_around() -> None:
    """Each stretch against the least squares of its own readings."""
    random = np.random.default_rng(5)
    motion = np.convolve(random.normal(size=460), np.hanning(60), "valid")
    series = motion.copy()
    series[random.choice(motion.size, 80, replace=False)] = np.nan
    series[200:230] = np.nan
    filled, *_ = missing_marks.guessed(series, motion, 3.1)
    mean = motion.mean()
    power = np.abs(np.fft.rfft(motion - mean, 2 * motion.size)) ** 2
    covariance = np.fft.irfft(power)[: motion.size] / motion.size
    for start, stop in missing_marks.missing_stretches(series):
        around = np.arange(max(0, start - missing_marks.REACH), min(series.size, stop + missing_marks.REACH))
        known, absent = around[np.isfinite(series[around])], np.arange(start, stop)
        each = covariance[np.abs(known[:, None] - known)] + 1e-12 * covariance[0] * np.eye(known.size)
        weights = np.linalg.solve(each, covariance[np.abs(known[:, None] - absent)])
        assert filled[start:stop] == pytest.approx(mean + (series[known] - mean) @ weights, rel=1e-9, abs=1e-9)
    assert np.array_equal(filled[np.isfinite(series)], series[np.isfinite(series)])


def test_an_hour_of_marks_goes_by_segments() -> None:
    """Swing and swell between the marks: a thousandth of the swing is left at the ends and where segments join."""
    step, factor, frequency = 0.5, 8, 2.0 * np.pi / 1.01
    fine = np.arange(7199 * factor + 1) * (step / factor)
    motion = 0.02 * np.exp(-1e-5 * fine) * np.cos(frequency * fine + 0.3) + 0.01 * np.sin(0.7 * fine)
    found, *_ = upsample.upsample(motion[::factor].copy(), step, frequency, factor)
    assert np.abs(found - motion).max() < 3e-5
    assert np.median(np.abs(found - motion)) < 1e-7


@pytest.mark.parametrize("factor", [2, 3])
def test_few_readings_a_swing_are_interpolated(factor: int) -> None:
    """Lines up to 0.8 of the Nyquist frequency to 150 dB; at the ends point reflection is right for a swell only."""
    time = np.arange(400 * factor + 1) / factor
    motion = np.cos(0.5 * np.pi * time + 0.4) + np.sin(0.8 * np.pi * time) + np.cos(0.14 * time)
    found = upsample.interpolated(motion[::factor].copy(), factor, *FEW_A_SWING)
    reach = FEW_A_SWING[0] * factor
    assert np.array_equal(found[::factor], motion[::factor])
    assert np.abs(found - motion)[reach:-reach].max() < 3e-7


def test_wild_readings_at_marks_are_found_and_nothing_else() -> None:
    """Neighbouring marks tell nothing of a reading; the envelope of minutes and the swell do."""
    step, frequency = 0.5, 2.0 * np.pi / 1.004
    time = np.arange(3600) * step
    random = np.random.default_rng(9)
    theta = 0.02 * np.cos(frequency * time + 0.1 * np.sin(time / 150.0)) + 0.004 * np.cos(0.8 * time)
    theta += random.normal(0.0, 1e-5, time.size)
    assert upsample.reject_at_marks(theta, step, frequency)[0] is theta
    wild = np.arange(60, 3600, 90)
    spoilt = theta.copy()
    spoilt[wild] += random.choice([-1.0, 1.0], wild.size) * 5e-4
    spoilt[[200, 2000]] = np.nan
    cleaned, count = upsample.reject_at_marks(spoilt, step, frequency)
    found = np.flatnonzero(np.isnan(cleaned) & np.isfinite(spoilt))
    assert count == found.size
    assert np.isin(wild, found).mean() > 0.95
    assert (~np.isin(found, wild)).sum() <= 1
    kept = np.isfinite(cleaned)
    assert np.array_equal(cleaned[kept], spoilt[kept])


def test_a_quick_beat_at_marks_is_not_wild() -> None:
    """Faster than the envelope's knots follow: a whole minute departs, and no single reading of it is to blame."""
    step, frequency = 0.5, 2.0 * np.pi / 1.004
    time = np.arange(3600) * step
    theta = 0.02 * np.cos(frequency * time) + 1e-6 * np.cos(0.8 * time)
    theta += 1e-4 * np.exp(-(((time - 900.0) / 20.0) ** 2)) * np.cos((frequency - 0.6) * time)
    assert upsample.reject_at_marks(theta, step, frequency)[1] < 10  # 450 if none were given back
