"""The light a trace leaves on a row: laws of the dwell time, and the integral done by brute force."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.film.tracking.motion import MOST_NODES, nodes_of, profile

SPOT = 1.2
NONE = np.empty((0, 2))


def light(state, gaps=NONE, shear=0.0, shift=0.0, tilt=0.0, size=240, row=50.5):
    nodes, out = np.zeros((3, MOST_NODES)), np.zeros((3, size))
    count = nodes_of(np.array(state), SPOT, shear, gaps, row, nodes)
    profile(nodes, count, shift, tilt, SPOT, 0, out)
    return out


def brute(state, gaps=NONE, shear=0.0, size=240, row=50.5):
    m, m1, m2, p, q, w = state
    s = (np.arange(-60000, 60000) + 0.5) * 2e-4
    x = m + s * (m1 + 0.5 * m2 * s) + p * np.cos(w * s) - q * np.sin(w * s)
    away = s + shear * (x - (m + p))
    weight = 2e-4 * np.exp(-0.5 * (away / SPOT) ** 2) / (np.sqrt(2 * np.pi) * SPOT)
    for begin, stop in gaps:
        weight[(row + away >= begin) & (row + away < stop)] = 0.0
    return np.array([np.sum(weight * np.exp(-0.5 * ((u + 0.5 - x) / SPOT) ** 2)) for u in range(size)])


@pytest.mark.parametrize("slope", [0.0, 0.7, -3.0, 12.0])
def test_a_straight_line_is_as_faint_and_wide_as_it_is_steep(slope):
    found = light([120.0, slope, 0.0, 0.0, 0.0, 0.1])
    stretch = np.sqrt(1.0 + slope**2)
    u = np.arange(240) + 0.5
    expected = np.exp(-0.5 * ((u - 120.0) / (SPOT * stretch)) ** 2) / stretch
    assert np.max(np.abs(found[0] - expected)) < 4e-4  # light beyond four spots is left out
    assert found[0].sum() == pytest.approx(np.sqrt(2 * np.pi) * SPOT, rel=3e-4)  # whatever the slope


TURNING = [100.0, 0.3, 0.01, 60.0, 0.5, 0.2]
STEEP = [100.0, -0.4, 0.0, 3.0, 60.0, 0.2]


@pytest.mark.parametrize("state", [TURNING, STEEP])
@pytest.mark.parametrize("shear", [0.0, 0.009])
@pytest.mark.parametrize("gaps", [NONE, np.array([[48.0, 49.2], [50.0, 51.8]])], ids=["open", "gaps"])
def test_it_is_the_integral_over_the_dwell_time(state, shear, gaps):
    assert np.max(np.abs(light(state, gaps, shear)[0] - brute(state, gaps, shear))) < 5e-4


@pytest.mark.parametrize("state", [TURNING, STEEP])
def test_its_derivatives_are_those_by_shift_and_by_slope(state):
    plain = light(state)
    for index, change in ((1, {"shift": 1e-4}), (2, {"tilt": 1e-4})):
        moved, back = light(state, **change), light(state, **{key: -value for key, value in change.items()})
        assert np.max(np.abs((moved[0] - back[0]) / 2e-4 - plain[index])) < 1e-3 * np.max(np.abs(plain[index]))
