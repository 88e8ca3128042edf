"""Slow flow: how phases, amplitudes and the beam's swing drift, and whether a synchronous regime of it is stable.

    alpha_i' = [ -Delta_i + delta^2/8 + Phi0^2 A_i^2/8 + Re(Q e^{2i alpha_i}) ]/2
    A_i'     = A_i [ Im(Q e^{2i alpha_i}) + delta (1 - A_i^2/4) ]/2
    Q'       = (i beta - delta0) Q - i (nu/8) sum A_j^2 e^{-2i alpha_j},          ' = d/dz,  u'' = 2 Re(Q e^{2iz})

Averaged over a swing: good to first order in delta, delta0, beta and Q. Its fixed points are
`balance.solutions` with shifts.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import UsageError
from synth.huygens.balance import Regime
from synth.huygens.clocks import Clocks, eigenvalues_beside, jacobian
from synth.phase import Floats


def rates(state: Any, beta: float, clocks: Clocks) -> Any:
    """Rates of (alpha_1, alpha_2, A_1, A_2, Re Q, Im Q) per z, (6,), at a real or complex state of these.

    `beta` is that of the frequency that z counts, w0^2/w^2 - 1.
    """
    stretch = math.sqrt(abs(1.0 + beta))
    delta, damping = clocks.drive * stretch, clocks.beam_damping * stretch
    real, imaginary = state[4], state[5]
    result = np.empty_like(state)
    result[4:] = -damping * real - beta * imaginary, beta * real - damping * imaginary
    for i in range(2):
        size, cosine, sine = state[2 + i], np.cos(2.0 * state[i]), np.sin(2.0 * state[i])
        own = (1.0 + beta) * (1.0 + clocks.detuning[i]) - 1.0 - delta**2 / 8.0 - (clocks.swing * size) ** 2 / 8.0
        result[i] = 0.5 * (real * cosine - imaginary * sine - own)
        result[2 + i] = 0.5 * size * (real * sine + imaginary * cosine + delta * (1.0 - size * size / 4.0))
        result[4:] -= clocks.coupling / 8.0 * size * size * np.array([sine, cosine])
    return result


def slopes(state: Floats, beta: float, clocks: Clocks) -> Floats:
    """Jacobian of `rates` by the state, (6, 6)."""
    return jacobian(lambda point: rates(point, beta, clocks), state)


class Stability(NamedTuple):
    """Verdict on a synchronous regime."""

    growth: float  # largest rate of a perturbation per z, the common phase apart
    exponents: tuple[complex, ...]  # all five, per z, the largest first
    stable: bool | None  # None where the largest rate is zero to rounding


def stability(regime: Regime, clocks: Clocks) -> Stability:
    """Whether a fixed point of the slow flow, a regime of `balance.solutions(clocks, shifts=True)`, is stable.

    `UsageError` if the regime is no fixed point of these clocks' slow flow.

    Examples
    --------
    In system (2) the paper's regime is a saddle, and quadrature attracts:

    >>> from synth.huygens.balance import solutions
    >>> pair = Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114))
    >>> [(abs(round(each.offset, 2)), stability(each, pair).stable) for each in solutions(pair, shifts=True)]
    [(1.57, True), (0.0, False)]
    """
    state = np.array([*regime.alpha, *regime.amplitude, regime.q, 0.0])
    if np.abs(rates(state, regime.beta, clocks)).max() > 1e-9:
        raise UsageError(
            "the regime is no fixed point of these clocks' slow flow; find it by solutions(..., shifts=True)"
        )
    common = np.array([1.0, 1.0, 0.0, 0.0, 0.0, -2.0 * regime.q])  # alpha + c, Q e^{-2ic}
    exponents = eigenvalues_beside(slopes(state, regime.beta, clocks), common)
    ordered = sorted(exponents, key=lambda each: -each.real)
    growth = ordered[0].real
    rounding = 1e-12 * max(abs(each) for each in ordered)
    return Stability(growth, tuple(ordered), None if abs(growth) <= rounding else growth < 0.0)
