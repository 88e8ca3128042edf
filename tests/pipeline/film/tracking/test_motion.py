"""The filter's steps against the closed form of the motion, finite differences and least squares."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.film.tracking.motion import advance, correct, place_variance, slope_of, slope_variance

STATE = np.array([100.0, 0.4, 0.003, 30.0, -50.0, 0.11])
QUIET = np.zeros(3)


def moved(state, rows, shear=0.0, covariance=None):
    state, spread = state.copy(), np.zeros((6, 6)) if covariance is None else covariance.copy()
    for _ in range(abs(rows)):
        advance(state, spread, QUIET, float(np.sign(rows)), shear)
    return state, spread


def along(state, s):
    m, m1, m2, p, q, w = state
    return m + s * (m1 + 0.5 * m2 * s) + p * np.cos(w * s) - q * np.sin(w * s)


def test_many_steps_are_one_long_one():
    state, _ = moved(STATE, 25)
    assert state[0] + state[3] == pytest.approx(along(STATE, 25.0), abs=1e-9)
    assert moved(state, -25)[0] == pytest.approx(STATE, abs=1e-9)


def test_on_a_sheared_film_a_step_leads_to_the_next_row_of_the_image():
    state, shear = STATE.copy(), 0.01
    for row in range(1, 12):
        state, _ = moved(state, 1, shear)
        x = state[0] + state[3]
        s = row - shear * (x - STATE[0] - STATE[3])
        assert x == pytest.approx(along(STATE, s), abs=1e-5)
    after, _ = moved(state, 1, shear)
    before, _ = moved(state, -1, shear)
    slope = 0.5 * (after[0] + after[3] - before[0] - before[3])
    assert slope_of(state, shear) == pytest.approx(slope, rel=0.02)


def test_covariances_follow_the_jacobian():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6)) * np.array([1, 0.1, 0.01, 1, 1, 1e-3])[:, None]
    spread = root @ root.T
    jacobian = np.empty((6, 6))
    for i in range(6):
        step = 1e-6 * max(1.0, abs(STATE[i]))
        up, down = STATE.copy(), STATE.copy()
        up[i] += step
        down[i] -= step
        jacobian[:, i] = (moved(up, 1)[0] - moved(down, 1)[0]) / (2 * step)
    _, found = moved(STATE, 1, covariance=spread)
    assert found == pytest.approx(jacobian @ spread @ jacobian.T, rel=1e-4, abs=1e-9)
    seen, slope = np.array([1.0, 0, 0, 1.0, 0, 0]), np.array([0, 1.0, 0, 0, -STATE[5], -STATE[4]])
    assert place_variance(STATE, spread, 0.0) == pytest.approx(seen @ spread @ seen)
    assert slope_variance(STATE, spread) == pytest.approx(slope @ spread @ slope)


def test_a_reading_is_weighed_as_least_squares_would():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(6, 6))
    spread, state = root @ root.T, STATE.copy()
    seen = np.array([1.0, 0, 0, 1.0, 0, 0])
    after = np.linalg.inv(np.linalg.inv(spread) + np.outer(seen, seen) / 0.3)
    expected = STATE + after @ seen * 2.0 / 0.3
    correct(state, spread, 2.0, 0.3, 0.0)
    assert state == pytest.approx(expected)
    assert spread == pytest.approx(after)
