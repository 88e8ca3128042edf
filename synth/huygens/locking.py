"""Whether two clocks lock: the slow flow, the stability of its regimes, how unlike the clocks may be, the slip beyond.

How phases, amplitudes and the beam's swing drift, averaged over a swing (good to first order in delta, delta0, beta
and Q; the fixed points are `balance.solutions` with shifts):

    alpha_i' = [ -Delta_i + delta^2/8 + Phi0^2 A_i^2/8 + Re(Q e^{2i alpha_i}) ]/2
    A_i'     = A_i [ Im(Q e^{2i alpha_i}) + delta (1 - A_i^2/4) ]/2
    Q'       = (i beta - delta0) Q - i (nu/8) sum A_j^2 e^{-2i alpha_j},          ' = d/dz,  u'' = 2 Re(Q e^{2iz})

To leading order in nu/(delta delta0) amplitudes and beam follow psi = alpha_1 - alpha_2 at once, and the slow flow is
Adler's equation `psi' = [(1 + beta)/2] (chi - chi_c sin 2 psi)`, signs apart. The slow flow's own slip is faster, since
amplitudes and beam help psi along.

A clock that is alone n swings a day faster keeps, once synchronised, an advance eta of phase instead: `chi` is the
difference tau_1 - tau_2 of the clocks when each is alone, 2 (1 + tau) n T/day (the paper lacks the 2: it expands w_i
with w0/4 where w0/8 stands), `eta` that of their alpha, k = d eta/d chi.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError, UsageError
from synth.huygens.balance import Regime, followed, solutions
from synth.huygens.clocks import Clocks, checked, eigenvalues_beside, jacobian
from synth.huygens.orbit import orbit

_BALANCE_STEP, _ORBIT_STEP = 1e-7, 1e-6  # chi: large against rounding over k, small against what makes k change
_FIRST, _STEP, _LEAST, _FURTHEST = 0.01, 0.1, 1e-11, 10.0  # of the leading order's edge, in following quadrature
_JUMP = 0.5  # rad in a step: another regime
_SETTLING, _SLIPS = 2, 6  # half turns of psi before the slip is measured, and while it is


def rates(state: Any, beta: float, clocks: Clocks) -> Any:
    """Rates of (alpha_1, alpha_2, A_1, A_2, Re Q, Im Q) per z, (6,); `beta` is that of the frequency z counts."""
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


class Stability(NamedTuple):
    """Verdict on a synchronous regime."""

    growth: float  # largest rate of a perturbation per z, the common phase apart
    exponents: tuple[complex, ...]  # all five, per z, the largest first
    stable: bool | None  # None where the largest rate is zero to rounding


def stability(regime: Regime, clocks: Clocks) -> Stability:
    """Whether a regime of `balance.solutions(clocks, shifts=True)` is stable; `UsageError` if it is no fixed point."""
    state = np.array([*regime.alpha, *regime.amplitude, regime.q, 0.0])
    if np.abs(rates(state, regime.beta, clocks)).max() > 1e-9:
        raise UsageError(
            "the regime is no fixed point of these clocks' slow flow; find it by solutions(..., shifts=True)"
        )
    common = np.array([1.0, 1.0, 0.0, 0.0, 0.0, -2.0 * regime.q])  # alpha + c, Q e^{-2ic}
    exponents = eigenvalues_beside(jacobian(lambda point: rates(point, regime.beta, clocks), state), common)
    ordered = sorted(exponents, key=lambda each: -each.real)
    growth = ordered[0].real
    rounding = 1e-12 * max(abs(each) for each in ordered)
    return Stability(growth, tuple(ordered), None if abs(growth) <= rounding else growth < 0.0)


def edge(clocks: Clocks) -> float:
    """chi_c to leading order in nu/(delta delta0): `(1 + beta) chi_c = nu delta0/(beta^2 + delta0^2)`.

    1 + beta = 1/(1 + tau - delta^2/8), with Phi0^2/2 less too in the full system. Within 7 % of the slow flow's own
    edge (`edge_of_balance`) at delta = delta0 = 0.02 and nu = 5.7e-5. Of the clocks their mean detuning counts.
    """
    beta = mean_beta(checked(clocks))
    damping = clocks.beam_damping * math.sqrt(1.0 + beta)
    return clocks.coupling * damping / (beta**2 + damping**2) / (1.0 + beta)


def mean_beta(clocks: Clocks) -> float:
    """beta of quadrature: of the frequency at which the clocks swing when the beam rests."""
    felt = clocks.mean_detuning - clocks.drive**2 / 8.0 - clocks.swing**2 / 2.0
    return 1.0 / (1.0 + felt) - 1.0


def edge_of_balance(clocks: Clocks) -> float:
    """Largest chi at which quadrature's descendant is stable: where it folds, or before (delta0 small) wavers (Hopf).

    Of the clocks their mean detuning counts. `RefusedError` if quadrature does not attract, or the family has no end.
    """
    return _last_stable(clocks)[0]


def _last_stable(clocks: Clocks) -> tuple[float, Regime]:
    """The edge of the slow flow, and the regime there."""
    unit = edge(clocks)
    chi, step = _FIRST * unit, _STEP * unit
    begin = clocks.detuned(chi)  # at chi = 0 itself the beam rests, and Newton's method has no hold
    regime = min(solutions(begin, shifts=True), key=lambda each: abs(abs(each.offset) - 0.5 * math.pi))
    if stability(regime, begin).growth > 0.0:
        raise RefusedError("quadrature itself does not attract these clocks; look at `solutions` at each chi")
    while step > _LEAST * unit:
        pair = clocks.detuned(chi + step)
        moved = followed(regime, pair, shifts=True)
        turned = math.inf if moved is None else abs(math.remainder(moved.offset - regime.offset, math.pi))
        if moved is not None and turned < _JUMP and stability(moved, pair).growth <= 0.0:
            regime, chi = moved, chi + step
        else:
            step *= 0.5
        if chi > _FURTHEST * unit:
            raise RefusedError("the regimes that grow out of quadrature have no end; look at `solutions` at each chi")
    return chi, regime


def slip(clocks: Clocks, chi: float) -> float:
    """Mean |d psi/dz| at chi beyond the edge, rad a unit of z, by the slow flow; 0 below it.

    Of the clocks their mean detuning counts. `RefusedError` as `edge_of_balance`.
    """
    from scipy.integrate import solve_ivp

    critical, regime = _last_stable(clocks)
    if abs(chi) <= critical:
        return 0.0
    pair = clocks.detuned(chi)
    adler = 0.5 * (1.0 + regime.beta) * math.sqrt(chi * chi - critical * critical)
    motion = solve_ivp(
        lambda _, state: rates(state, regime.beta, pair),  # in the frame of the regime beside which psi waits
        (0.0, (_SETTLING + _SLIPS + 1) * math.pi / adler),  # Adler's slip is the slower
        [0.0, 0.5 * math.pi, 2.0, 2.0, 0.0, 0.0],
        method="LSODA",
        events=lambda _, state: math.sin(state[0] - state[1]),
        rtol=1e-8,
        atol=1e-10,
    )
    assert motion.t_events is not None  # since an event is given
    passages = motion.t_events[0][_SETTLING:]
    return float(math.pi * (passages.size - 1) / (passages[-1] - passages[0]))


def slope(regime: Regime, clocks: Clocks, *, shifts: bool = False) -> float:
    """k of the six equations (7)-(8) at the clocks' own tau and chi, by following a regime to both sides.

    The regime is one of `balance.solutions` with the same `shifts`. `RefusedError` if it ends right here.
    """
    apart = clocks.detuning[0] - clocks.detuning[1]
    pairs = (clocks.detuned(apart + step) for step in (_BALANCE_STEP, -_BALANCE_STEP))
    above, below = (followed(regime, pair, shifts=shifts) for pair in pairs)
    if above is None or below is None:
        raise RefusedError("the regime ends at this difference of rates; take k at a smaller one")
    return math.remainder(above.offset - below.offset, math.pi) / (2.0 * _BALANCE_STEP)


def orbit_slope(regime: Regime, clocks: Clocks, *, full: bool = False) -> float:
    """k of the true orbits near a regime (from `balance.solutions` with shifts), of system (2) or the full one."""
    apart = clocks.detuning[0] - clocks.detuning[1]
    pairs = (clocks.detuned(apart + step) for step in (_ORBIT_STEP, -_ORBIT_STEP))
    above, below = (orbit(regime, pair, full=full).regime.offset for pair in pairs)
    return math.remainder(above - below, math.pi) / (2.0 * _ORBIT_STEP)
