"""Guesses of the remainder: sequences that each of them foretells exactly, and the choice among them."""

from __future__ import annotations

import numpy as np
import pytest

from synth.integrators.collocation_march import ORDERS, best, guess, remember
from synth.kernels.collocation import FINE, NODES, continuation, gauss_nodes
from synth.phase import Floats

NODE = (1.0 + gauss_nodes() / FINE) / 2.0
MIRROR = np.array([1.0, -1.0])
CONTINUATION = continuation().T.reshape(1, -1)


def remainder(interval: int, lag: int, degree: int) -> Floats:
    """Of a motion that changes its sign, as `MIRROR` has it, and its size by a polynomial, every `lag` intervals."""
    swing, place = divmod(interval, lag)
    shape = np.sin(3.0 * (NODE + place))
    return np.array([shape * sign**swing * (1.0 + 0.1 * swing) ** degree for sign in MIRROR])


def after(intervals: list[Floats], lag: int) -> tuple[Floats, int]:
    """Memory of these intervals, and the row of the next."""
    memory, known = np.zeros((lag, ORDERS, 2, NODES)), np.zeros((2, 2, NODES))
    for i, each in enumerate(intervals):
        known[0] = each
        remember(memory, i % lag, MIRROR, known, 0)
    return memory, len(intervals) % lag


@pytest.mark.parametrize("lag", [1, 3])
@pytest.mark.parametrize("degree", [0, 1, 3])
def test_differences_foretell_what_repeats_itself(lag: int, degree: int) -> None:
    count = 7 * lag + 1
    memory, slot = after([remainder(i, lag, degree) for i in range(count)], lag)
    known = np.zeros((2, 2, NODES))
    errors = []
    for which in range(ORDERS):
        guess(memory, slot, which, MIRROR, CONTINUATION, known, 1)
        errors.append(np.max(np.abs(known[1] - remainder(count, lag, degree))))
    assert max(errors[degree + 1 :]) < 1e-13  # as many differences as the polynomial has coefficients
    assert min(errors[: degree + 1]) > 1e-3


def test_the_polynomial_continues_the_interval_before() -> None:
    memory, slot = after([np.array([(NODE + i) ** 3, NODE + i]) for i in range(4)], 3)
    known = np.zeros((2, 2, NODES))
    guess(memory, slot, ORDERS, MIRROR, CONTINUATION, known, 0)
    np.testing.assert_allclose(known[0], [(NODE + 4) ** 3, NODE + 4], rtol=2e-5)  # of high degree: amplifies rounding


def test_the_best_guess_missed_least() -> None:
    memory, slot = after([remainder(i, 1, 2) for i in range(8)], 1)
    worth = np.ones(2)
    assert best(memory, slot, worth, 1.0) >= 3  # differences of that order vanish
    assert best(memory, slot, worth, 0.0) == ORDERS
    np.testing.assert_allclose(memory[slot, 3], 0.0, atol=1e-13)
