"""One row of one or two traces: what was put in comes out, and the variance is that of the readings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.film.emulsion import Optics, ToneCurve
from pipeline.film.tracking.motion import MOST_NODES, nodes_of, profile, solve
from pipeline.film.tracking.row_reading import read_row

SPOT, COLUMNS = 1.2, 200
CURVE = ToneCurve(0.63, 0.2, 1.5)
GRAIN = np.array([5e-5, 1e-3])


def row_of(states, shifts, lamps):
    exposure = np.zeros(COLUMNS)
    for state, shift, lamp in zip(states, shifts, lamps, strict=True):
        nodes, out = np.zeros((3, MOST_NODES)), np.zeros((3, COLUMNS))
        count = nodes_of(state, SPOT, 0.0, np.empty((0, 2)), 10.5, nodes)
        profile(nodes, count, shift, 0.0, SPOT, 0, out)
        exposure += lamp * out[0]
    return CURVE.darkness(exposure)


def read(darkness, states, prior=math.inf, slope_variance=1e-10):
    traces = len(states)
    return read_row(
        darkness.astype(np.float32),
        10.5,
        np.array(states),
        np.ones(traces, np.int64),
        Optics(SPOT, 0.0, CURVE, GRAIN).lens,
        np.ones(traces),
        np.tile([prior, slope_variance], (traces, 1)),
        np.empty((0, 2)),
        np.zeros(traces + 1, np.int64),
        1e-3,
    )


FLAT = np.array([70.3, 0.1, 0.0, 20.0, 0.5, 0.2])
STEEP = np.array([98.0, -0.1, 0.0, 2.0, -30.0, 0.2])
RISING = np.array([104.0, 0.2, 0.0, 2.0, 25.0, 0.2])


def test_a_matrix_times_its_inverse_is_one():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(5, 5))
    matrix, right = root @ root.T, rng.normal(size=5)
    inverse, answer = matrix.copy(), right.copy()
    assert solve(inverse, answer, 5)
    assert matrix @ inverse == pytest.approx(np.eye(5), abs=1e-9)
    assert matrix @ answer == pytest.approx(right)
    assert not solve(np.zeros((2, 2)), np.zeros(2), 2)


@pytest.mark.parametrize(
    ("states", "shifts"),
    [([FLAT], [0.3]), ([STEEP], [-2.0]), ([STEEP, RISING], [1.0, -1.5]), ([FLAT, STEEP], [0.1, 1])],
)
def test_what_was_put_in_comes_out(states, shifts):
    lamps = [1.1, 0.9][: len(states)]
    found = read(row_of(states, shifts, lamps), states)
    # without noise; what is known of the brightness before draws a little where lines lie on each other
    assert np.all(np.abs(found[:, 0] - shifts) < 0.01 + 0.3 * np.sqrt(found[:, 1]))
    assert np.all(np.abs(found[:, 2] - lamps) < 0.01 + 0.3 * np.sqrt(found[:, 3]))
    assert np.all(found[:, 5] <= found[:, 1] * 1.001)  # another trace never makes a reading surer


@pytest.mark.compiled
@pytest.mark.parametrize("states", [[FLAT], [STEEP], [STEEP, RISING]], ids=["flat", "steep", "crossing"])
def test_readings_scatter_by_their_sigma(states):
    rng = np.random.default_rng(5)
    clean = row_of(states, [0.0] * len(states), [1.0] * len(states))
    sigma = np.sqrt(GRAIN[0] + GRAIN[1] * clean)
    found = np.array([read(clean + sigma * rng.normal(size=COLUMNS), states) for _ in range(1500)])
    ratio = found[:, :, 0].std(axis=0) / np.sqrt(found[:, :, 1].mean(axis=0))
    assert np.abs(ratio - 1.0).max() < 0.08  # 1500 draws tell it to 2 %, the fit's being nonlinear some more
    assert np.abs(found[:, :, 0].mean(axis=0)).max() < 4.0 * np.sqrt(found[:, :, 1].mean() / 1500) + 0.02


def test_where_two_traces_lie_on_each_other_the_reading_says_that_it_knows_nothing():
    close = STEEP + np.array([0.3, 0, 0, 0, 0, 0])
    found = read(row_of([STEEP, close], [0.0, 0.0], [1.0, 1.0]), [STEEP, close])
    assert np.all(found[:, 1] > 20.0 * found[:, 5])
    known = read(row_of([STEEP, close], [0.0, 0.0], [1.0, 1.0]), [STEEP, close], prior=1e-4)
    assert np.all(known[:, 1] < 0.5 * found[:, 1])  # the one, where the other is known


def test_the_slopes_uncertainty_costs_most_beside_a_turning_point():
    beside = np.array([70.3, 0.1, 0.0, 18.0, -9.0, 0.2])
    costs = []
    for each in (STEEP, beside):
        row = row_of([each], [0.0], [1.0])
        costs.append(read(row, [each], slope_variance=0.25)[0, 1] / read(row, [each])[0, 1])
    assert costs[1] > costs[0] >= 0.999
