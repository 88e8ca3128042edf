"""Weights of collocation against 40 digits, and eight doubles at once against NumPy."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest

from synth.kernels.collocation import FINE, NODES, gauss_nodes, turned, weights
from synth.kernels.compiled import kernel
from synth.kernels.lanes import LANES, load, positive, store, total
from synth.phase import Floats

NODE = (1.0 + gauss_nodes() / FINE) / 2.0
OSCILLATORS = pytest.mark.parametrize(
    ("square", "loss", "interval"),
    [(39.4, 0.0, 0.5), (158.0, 0.25, 0.3), (4.0, 6.0, 0.4), (-9.0, 0.1, 0.3), (0.0, 0.0, 0.7), (0.0, 0.5, 0.7)],
)


def exact(square: float, loss: float, time: Any) -> tuple[Any, Any]:
    """K and K'."""
    half = mpmath.mpf(loss) / 2
    root = mpmath.sqrt(mpmath.mpc(mpmath.mpf(square) - half**2))
    sine = time if abs(root * time) < 1e-18 else (mpmath.sin(root * time) / root).real
    fade = mpmath.exp(-half * time)
    return fade * sine, fade * (mpmath.cos(root * time).real - half * sine)


@OSCILLATORS
def test_propagator_and_flow_have_40_digits_behind_them(square: float, loss: float, interval: float) -> None:
    made = weights(square, loss, interval)
    with mpmath.workdps(40):
        own, slope = exact(square, loss, mpmath.mpf(interval))
        entries = (slope + loss * own, own, -mpmath.mpf(square) * own, slope)
        for found, expected in zip(made.propagator.reshape(4, 4), entries, strict=True):
            assert found[0] + found[1] == found[2]
            assert abs(mpmath.mpf(found[2]) + mpmath.mpf(found[3]) - expected) < 1e-30 * (1 + abs(expected))
        at_nodes = [exact(square, loss, mpmath.mpf(float(node)) * mpmath.mpf(interval)) for node in NODE]
        expected_flow = [float(slope + loss * own) for own, slope in at_nodes]
    np.testing.assert_allclose(made.flow[:NODES], expected_flow, rtol=0, atol=1e-15)


@OSCILLATORS
@pytest.mark.parametrize("power", [0, 3, 15])
def test_answers_to_powers_of_time(square: float, loss: float, interval: float, power: int) -> None:
    """r of the nodes' degree is answered exactly, at the end with what rounding left."""
    made = weights(square, loss, interval)
    forcing = NODE**power
    with mpmath.workdps(40):
        for place, kept in ((1.0, None), (float(NODE[5]), 5)):
            end = mpmath.mpf(interval) * mpmath.mpf(place)

            def answer(which: int, end: Any = end) -> float:
                return float(
                    mpmath.quad(lambda s: exact(square, loss, end - s)[which] * (s / interval) ** power, [0, end])
                )

            if kept is None:
                rows = made.end.reshape(4, NODES)
                found = [float(rows[0] @ forcing + rows[2] @ forcing), float(rows[1] @ forcing + rows[3] @ forcing)]
            else:
                found = (made.inner.reshape(2, NODES, NODES)[:, :, kept].T.T @ forcing).tolist()
            # rounding of 16 weights of alternating sign
            assert found == pytest.approx([answer(0), answer(1)], rel=1e-13, abs=1e-16)


@kernel
def _work(values: Floats, out: Floats) -> float:
    first, second = load(values, (0, 0)), load(values, (1, LANES))
    store(out, (0, 0), first + second * 2.0 - 3.0 / first)
    store(out, (0, LANES), abs(-first) * positive(second))
    first += 1.0
    first -= second
    first *= 2.0
    store(out, (1, 0), first)
    return total(second)


def test_all_at_once_are_what_numpy_says() -> None:
    values = np.random.default_rng(3).normal(size=(2, 2 * LANES))
    out = np.zeros((2, 2 * LANES))
    summed = _work(values, out)
    (above, product), (below, rest) = out.reshape(2, 2, LANES)
    first, second = values[0, :LANES], values[1, LANES:]
    assert summed == pytest.approx(second.sum(), rel=1e-14)
    np.testing.assert_allclose(above, first + second * 2 - 3 / first, rtol=1e-15, atol=1e-15)  # fused products
    np.testing.assert_array_equal(product, np.abs(first) * np.where(second > 0, second, np.nan))
    np.testing.assert_array_equal(below, (first + 1.0 - second) * 2.0)
    np.testing.assert_array_equal(rest, 0.0)


@kernel
def _turn(angles: Floats, out: Floats) -> None:
    for j in range(0, angles.size, LANES):
        sine, cosine, short, _ = turned(load(angles, (j,)))
        store(out, (0, j), sine)
        store(out, (1, j), cosine)
        store(out, (2, j), short)


def test_sine_and_cosine_of_any_angle() -> None:
    rng = np.random.default_rng(5)
    angles = np.concatenate(
        [rng.uniform(-1.6, 1.6, 64), rng.uniform(-7, 7, 64), 1e-5 * rng.normal(size=8), np.zeros(8)]
    )
    out = np.empty((3, angles.size))
    _turn(angles, out)
    np.testing.assert_allclose(out[:2], [np.sin(angles), np.cos(angles)], atol=2.5e-16)
    with mpmath.workdps(40):
        short = [float(mpmath.mpf(each) - mpmath.sin(mpmath.mpf(each))) for each in angles]
    np.testing.assert_allclose(out[2], short, rtol=2e-15, atol=1e-30)
    mirrored = np.empty_like(out)
    _turn(-angles, mirrored)
    np.testing.assert_array_equal(mirrored, out * [[-1], [1], [-1]])
