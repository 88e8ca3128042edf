"""Both directions together are the weighted mean of two estimates."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.film.tracking.pieces import Piece, combined

SPOT = 1.2
STATE = np.array([100.0, 0.2, 0.0, 30.0, -50.0, 0.11])


def a_piece(seed, followed=1):
    rng = np.random.default_rng(seed)
    piece = Piece(*np.zeros((3, 1, 1)), np.zeros((1, 1), np.uint8), np.zeros((1, 1, 6)), np.zeros((1, 1, 6, 6)))
    root = rng.normal(size=(6, 6)) * np.array([0.1, 0.01, 1e-3, 0.1, 0.1, 1e-4])[:, None]
    piece.covariances[0, 0] = root @ root.T
    piece.states[0, 0] = STATE + root @ rng.normal(size=6)
    piece.followed[0, 0] = followed
    return piece


def test_two_estimates_are_weighed_by_their_information():
    one, other = a_piece(1), a_piece(2)
    states, variance, slope_variance, apart, known = combined(one, other, SPOT, 0.0)
    a, b = np.linalg.inv(one.covariances[0, 0]), np.linalg.inv(other.covariances[0, 0])
    spread = np.linalg.inv(a + b)
    assert states[0, 0] == pytest.approx(spread @ (a @ one.states[0, 0] + b @ other.states[0, 0]), rel=1e-6)
    seen = np.array([1.0, 0, 0, 1.0, 0, 0])
    assert variance[0, 0] == pytest.approx(seen @ spread @ seen, rel=1e-5)
    w, q = states[0, 0, 5], states[0, 0, 4]
    slope = np.array([0, 1.0, 0, 0, -w, -q])
    assert slope_variance[0, 0] == pytest.approx(slope @ spread @ slope, rel=1e-4)
    assert known[0, 0] == 3
    assert apart[0, 0] < 3.0


def test_a_trace_known_from_one_side_keeps_that_sides_course():
    one, other = a_piece(1), a_piece(2, followed=0)
    for forth, back, code in ((one, other, 1), (other, one, 2)):
        states, _, _, apart, known = combined(forth, back, SPOT, 0.0)
        assert states[0, 0] == pytest.approx(one.states[0, 0])
        assert (known[0, 0], apart[0, 0]) == (code, 0.0)
    assert combined(other, other, SPOT, 0.0).known[0, 0] == 0


def test_directions_that_disagree_say_so():
    one, other = a_piece(1), a_piece(2)
    other.states[0, 0, 0] += 40.0
    assert combined(one, other, SPOT, 0.0).disagreement[0, 0] > 6.0
