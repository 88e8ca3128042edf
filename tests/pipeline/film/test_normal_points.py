"""Rows become samples: exact for a noiseless film, deaf to the course's prior, white, no reading twice."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.film.normal_points import between_rows, course_at, normal_points, row_times
from pipeline.film.parts import TimeAxis, Tracks

ROWS_PER_SECOND, PERIOD, AMPLITUDE = 59.06, 1.00966, 118.0
SIGMA = 0.5


def motion(t, frequency_error=0.0, slow=40.0):
    n = 2.0 * np.pi / PERIOD * (1.0 + frequency_error)
    w = 2.0 * np.pi / 11.0
    phase, roll = n * t + 0.4, w * t
    place = 700.0 + AMPLITUDE * np.cos(phase) + slow * np.sin(roll)
    speed = -AMPLITUDE * n * np.sin(phase) + slow * w * np.cos(roll)
    return place, speed, -AMPLITUDE * n**2 * np.cos(phase) - slow * w**2 * np.sin(roll)


def film(seconds, *, shear=0.0, offset=0.0, course_error=0.0, noise=0.0, seed=0):
    """Tracks of two traces, the second lying `offset` rows later, as an ideal tracker would read them."""
    count = round(seconds * ROWS_PER_SECOND)
    rows = np.arange(count) + 0.5
    rng = np.random.default_rng(seed)
    read, smooth, slopes, bends = [], [], [], []
    for late in (0.0, offset):
        for error, places in ((0.0, read), (course_error, smooth)):
            t = (rows - late) / ROWS_PER_SECOND
            for _ in range(60):  # the image lags by the column
                t = (rows - late - shear * motion(t, error)[0]) / ROWS_PER_SECOND
            place, speed, bend = motion(t, error)
            places.append(place)
            if places is smooth:
                dtdr = 1.0 / (ROWS_PER_SECOND + shear * speed)
                slopes.append(speed * dtdr)
                bends.append(bend * dtdr**2 - speed * dtdr**3 * shear * bend)
    shape, none = (2, count), np.empty(0)
    tracks = Tracks(
        position=np.array(read) + noise * rng.standard_normal(shape),
        sigma=np.full(shape, SIGMA),
        course=np.array(smooth),
        slope=np.array(slopes),
        curvature=np.array(bends),
        brightness=np.ones(shape),
        qc=np.zeros(shape, dtype=np.uint16),
        rows_per_swing=ROWS_PER_SECOND * PERIOD,
        spot=1.2,
    )
    axis = TimeAxis(
        index=none.astype(np.int64),
        row=none,
        row_sigma=none,
        shear=shear,
        offset=np.array([0.0, offset]),
        row_of_trace=np.empty((2, 0)),
        interval=0.5,
        seconds=rows / ROWS_PER_SECOND,
        seconds_sigma=np.zeros(count),
        flags=(),
        rate_sigma=0.0,
    )
    return tracks, axis


@pytest.mark.parametrize(("shear", "offset"), [(0.0, 0.0), (np.tan(np.radians(0.5)), 17.7), (-0.02, -5.0)])
def test_samples_of_a_film_without_noise_are_the_motion(shear, offset):
    tracks, axis = film(20.0, shear=shear, offset=offset)
    samples = normal_points(tracks, axis, 25.0)
    np.testing.assert_allclose(np.diff(samples.time), 0.04, rtol=0, atol=1e-12)
    known = np.isfinite(samples.column)
    assert known.mean() > 0.95
    wrong = samples.column - motion(samples.time)[0]
    assert np.abs(wrong[known]).max() < 2e-3  # px: Hermite's quintic over a tenth of a radian


def test_each_row_of_each_trace_has_its_own_time():
    tracks, axis = film(10.0, shear=0.01, offset=12.0)
    for trace in range(2):
        seconds = row_times(tracks, axis, trace)
        known = np.isfinite(seconds)
        np.testing.assert_allclose(motion(seconds[known])[0], tracks.course[trace][known], atol=1e-9)


def phase_rate(samples, trace):
    """Frequency by least squares on the samples, relative to the true one."""
    t, y = samples.time, samples.column[trace]
    good = np.isfinite(y)
    t, y = t[good], y[good]
    n, w = 2.0 * np.pi / PERIOD, 2.0 * np.pi / 11.0
    columns = [
        np.cos(n * t),
        np.sin(n * t),
        t * np.cos(n * t),
        t * np.sin(n * t),
        np.ones_like(t),
        np.cos(w * t),
        np.sin(w * t),
    ]
    a, b, c, d = np.linalg.lstsq(np.stack(columns, axis=1), y, rcond=None)[0][:4]
    return (b * c - a * d) / (a * a + b * b) / n  # of a cos + b sin, the phase's rate at t = 0


def test_a_wrong_frequency_in_the_course_does_not_reach_the_phase():
    tracks, axis = film(120.0, course_error=1e-3)
    alone = dataclasses.replace(tracks, position=tracks.course)
    assert abs(phase_rate(normal_points(alone, axis, 25.0), 0)) > 3e-4  # the course alone would be far off
    assert abs(phase_rate(normal_points(tracks, axis, 25.0), 0)) < 1e-6


def test_noise_of_the_samples_is_white_and_of_the_size_they_state():
    tracks, axis = film(400.0, noise=SIGMA)
    samples = normal_points(tracks, axis, 25.0)
    wrong = ((samples.column - motion(samples.time)[0]) / samples.sigma)[0]
    wrong = wrong[np.isfinite(wrong)]
    count = wrong.size
    assert abs(wrong.std() - 1.0) < 4.0 / np.sqrt(2.0 * count)
    for lag in (1, 2, 3, 25):
        assert abs(np.mean(wrong[lag:] * wrong[:-lag])) < 4.0 / np.sqrt(count)


def test_no_reading_counts_twice():
    tracks, axis = film(60.0)
    for row in (1000, 1001, 1777):
        touched = tracks.position.copy()
        touched[0, row] += 1.0
        before = normal_points(tracks, axis, 25.0).column[0]
        after = normal_points(dataclasses.replace(tracks, position=touched), axis, 25.0).column[0]
        moved = np.flatnonzero(np.abs(after - before) > 0.05)
        assert moved.size == 1


def test_samples_without_an_accepted_row_are_missing_and_keep_the_rows_flags():
    tracks, axis = film(20.0)
    position, qc = tracks.position.copy(), tracks.qc.copy()
    position[0, 500:520], qc[0, 500:520] = np.nan, 1  # a gap
    qc[0, 700:703] = 64  # an overlap that was read all the same
    samples = normal_points(dataclasses.replace(tracks, position=position, qc=qc), axis, 25.0)
    at = {row: round(row / ROWS_PER_SECOND * 25.0) - round(samples.time[0] * 25.0) for row in (510, 701)}
    assert np.isnan(samples.column[0, at[510]])
    assert np.isnan(samples.sigma[0, at[510]])
    assert samples.qc[0, at[510]] == 1
    assert np.isfinite(samples.column[0, at[701]])
    assert samples.qc[0, at[701]] == 64
    assert np.isfinite(samples.column[1, at[510]])


def test_where_the_trace_is_lost_nothing_is_made_up():
    tracks, axis = film(20.0)
    course, position = tracks.course.copy(), tracks.position.copy()
    course[1, 300:600], position[1, 300:600] = np.nan, np.nan
    samples = normal_points(dataclasses.replace(tracks, course=course, position=position), axis, 25.0)
    inside = (samples.time > 302 / ROWS_PER_SECOND) & (samples.time < 598 / ROWS_PER_SECOND)
    assert np.isnan(samples.column[1, inside]).all()
    assert (samples.qc[1, inside] == 32).all()
    assert np.isfinite(samples.column[0, inside]).all()


def test_no_time_gives_no_samples():
    tracks, axis = film(5.0)
    empty = normal_points(tracks, dataclasses.replace(axis, seconds=np.full_like(axis.seconds, np.nan)), 25.0)
    assert empty.time.size == 0
    assert empty.column.shape == (2, 0)


def test_a_curve_is_a_quintic_between_rows() -> None:
    tracks, _ = film(2.0)
    row = np.arange(tracks.course.shape[1]) + 0.5
    x = np.array([3.2, 7.9, 15.5])
    curve = {"course": 1e-3 * row**5, "slope": 5e-3 * row**4, "curvature": 2e-2 * row**3}
    tracks = dataclasses.replace(tracks, **{name: values[None] for name, values in curve.items()})
    np.testing.assert_allclose(between_rows(tracks, 0, x), 1e-3 * x**5, rtol=1e-10)
    assert np.isnan(between_rows(tracks, 0, np.array([np.nan]))).all()


def test_a_trace_that_was_never_followed_has_no_course():
    tracks, axis = film(20.0)
    tracks.course[1] = np.nan
    assert np.isnan(course_at(tracks, axis, 1, row_times(tracks, axis, 1), np.arange(3.0))).all()


def test_there_is_no_sample_where_readings_lie_on_one_side_alone():
    tracks, axis = film(40.0, course_error=1e-3)
    rate, rows = 12.5, np.arange(tracks.course.shape[1])
    hidden = np.abs((rows + 0.5) / ROWS_PER_SECOND % 0.5 - 0.25) < 0.06  # about every second sample
    position = np.where(hidden, np.nan, tracks.position)
    samples = normal_points(dataclasses.replace(tracks, position=position), axis, rate)
    seconds = (rows[~hidden] + 0.5) / ROWS_PER_SECOND
    after = np.searchsorted(seconds, samples.time)
    apart = seconds[np.clip(after, 1, seconds.size - 1)] - seconds[np.clip(after, 1, seconds.size - 1) - 1]
    amid = apart > 2.0 / ROWS_PER_SECOND  # among hidden rows
    read = np.isfinite(samples.column[0])
    assert amid.mean() > 0.1
    near = np.min(np.abs(samples.time[:, None] - seconds), axis=1) < 0.76 / ROWS_PER_SECOND
    assert not np.any(read & amid & ~near)
    assert np.mean(read[~amid]) > 0.95
