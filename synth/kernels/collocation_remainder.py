"""What a pendulum has beyond its linear part, at the nodes of an interval.

    r = (theta - sin theta) - zeta sin theta + u (1 - cos theta) - drive

    r = -zeta theta - drive                                        where the law is linear

The kernels take theta (pendulums, NODES), zeta, u and drive (intervals, NODES), the pendulum, the interval, and where
to put r: `known[now, pendulum]`. They are odd in (theta, u, drive) to the last bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synth.kernels.compiled import kernel, summing_kernel

NODES = 16
"""Gauss nodes of an interval."""

_ROUNDER = 6755399441055744.0  # 1.5 * 2^52: adding and subtracting it rounds to a whole number
_HALF_CIRCLE = (3.141592653589793116, 1.2246467991473532072e-16)


@summing_kernel
def remainder_small(
    theta: Any, vertical: Any, horizontal: Any, drive: Any, p: int, i: int, known: Any, now: int
) -> None:
    """Taylor polynomials, for |theta| < 0.5: short by less than 5e-17 of theta."""
    for j in range(NODES):
        x = theta[p, j]
        s = x * x
        short = 1 / 39916800 - s * (1 / 6227020800)
        short = s * (1 / 6 + s * (-1 / 120 + s * (1 / 5040 + s * (-1 / 362880 + s * short)))) * x
        rise = 1 / 3628800 + s * (-1 / 479001600 + s * (1 / 87178291200))
        rise = s * (0.5 + s * (-1 / 24 + s * (1 / 720 + s * (-1 / 40320 + s * rise))))
        known[now, p, j] = short - vertical[i, j] * (x - short) + horizontal[i, j] * rise - drive[i, j]


@summing_kernel
def remainder_linear(
    theta: Any, vertical: Any, horizontal: Any, drive: Any, p: int, i: int, known: Any, now: int
) -> None:
    """The linear law, which the support's horizontal acceleration does not change."""
    for j in range(NODES):
        known[now, p, j] = -vertical[i, j] * theta[p, j] - drive[i, j]


@kernel
def remainder_general(
    theta: Any, vertical: Any, horizontal: Any, drive: Any, p: int, i: int, known: Any, now: int
) -> None:
    """Any angle: sine and cosine of half the angle, itself reduced to a quarter turn either way."""
    for j in range(NODES):
        x = theta[p, j]
        half_turns = (x * (1 / np.pi) + _ROUNDER) - _ROUNDER
        rest = (x - half_turns * _HALF_CIRCLE[0]) - half_turns * _HALF_CIRCLE[1]
        pairs = (half_turns * 0.5 + _ROUNDER) - _ROUNDER
        sign = 1.0 - 2.0 * abs(half_turns - 2.0 * pairs)
        h = 0.5 * rest
        s = h * h
        sine = 1 / 6227020800 + s * (-1 / 1307674368000 + s * (1 / 355687428096000))
        sine = -1 / 6 + s * (1 / 120 + s * (-1 / 5040 + s * (1 / 362880 + s * (-1 / 39916800 + s * sine))))
        sine = h + h * (s * sine)
        cosine = 1 / 479001600 + s * (-1 / 87178291200 + s * (1 / 20922789888000))
        cosine = -0.5 + s * (1 / 24 + s * (-1 / 720 + s * (1 / 40320 + s * (-1 / 3628800 + s * cosine))))
        cosine = 1.0 + s * cosine
        full = sign * (2.0 * sine * cosine)
        rise = 1.0 - sign * (1.0 - 2.0 * sine * sine)
        known[now, p, j] = (x - full) - vertical[i, j] * full + horizontal[i, j] * rise - drive[i, j]
