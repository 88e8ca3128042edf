"""How white noise of the first pendulum's trace reaches n2, by the adjoint of the nonlinear identity."""

from __future__ import annotations

import numpy as np

from data_schemas.scratch import portions, release, room
from pipeline.arrays import Floats
from pipeline.inversion.kernels import cosine_less_one, sine_over
from synth.kernels.compiled import kernel, summing_kernel

BESIDE = 3  # samples on both sides that the taps of a second difference reach


@kernel
def adjoint(
    influence: Floats, slope: Floats, turn: complex, oscillation: float, step: float, state: complex, out: Floats
) -> complex:
    """`out[k] = sum_{j > k} G(t_j - t_k) influence[j]`, G the response to a unit impulse; all (n,).

    slope is the part of the stiffness that changes with time, as the recursion has it. The recursion runs backwards:
    `state` is what the samples behind the last have left, nought at a record's end; returned is what is left for those
    before the first.
    """
    unit = 1.0 / oscillation
    for k in range(influence.size - 1, -1, -1):
        out[k] = state.imag * unit
        state = turn * (state + influence[k] + step * slope[k] * state.imag * unit)
    return state


@summing_kernel
def through(
    back: Floats,
    theta: Floats,
    curvature: Floats,
    about: Floats,
    stiffness: Floats,
    linear: tuple[float, float, float],
    curve: tuple[float, float, float, float],
    out: Floats,
) -> None:
    """What theta1 does to the forcing, turned into d n2 by `back`; all arrays (n,).

    linear: the step, and factors of `back` and of its next less its last value; curve: taps of `step r d^2/dt^2`.
    """
    count = out.size
    bent = np.zeros(count + 6)
    step, straight, turned = linear
    c0, c1, c2, c3 = curve
    for k in range(count):
        d, t = about[k], theta[k]
        dd, tt = d * d, t * t
        secant = 1.0 / (1.0 + cosine_less_one(tt))
        tangent = t * sine_over(tt) * secant
        sine = d * sine_over(dd)
        lever = (stiffness[k] * tangent + curvature[k] * secant) * secant * sine
        bent[k + 3] = (cosine_less_one(dd) + tangent * sine) * back[k]
        out[k] = (straight + step * lever) * back[k]
    b0, b1, b2, b3, b4, b5, b6 = bent, bent[1:], bent[2:], bent[3:], bent[4:], bent[5:], bent[6:]
    for k in range(count):
        out[k] += (c0 * b3[k] + c1 * (b2[k] + b4[k])) + (c2 * (b1[k] + b5[k]) + c3 * (b0[k] + b6[k]))
    for k in range(1, count - 1):
        out[k] += turned * (back[k + 1] - back[k - 1])


def theta_influence(
    influence: Floats,
    slope: Floats,
    theta: Floats,
    curvature: Floats,
    about: Floats,
    stiffness: Floats,
    step: float,
    eigenvalue: complex,
    ratio: float,
    frequency: float,
    damping_difference: float,
    out: Floats | None = None,
    deaf: bool = False,
) -> Floats:
    """d n2 / d theta1 at every sample, s-1.

    Parameters
    ----------
    influence : (n,) array
        d n2 / d (reading of the difference), s-1.
    slope, theta, curvature, about : (n,) arrays
        Time-varying stiffness s-2, first pendulum, n2^2 w, difference, as the inversion has them.
    stiffness : (n,) array
        n2^2 (1 + zeta), s-2.
    deaf : bool
        Whether the filter of the curvature has a notch at the third harmonic.
    """
    count = influence.size
    back = room(count)
    turn, state = complex(np.exp(eigenvalue * step)), 0.0j
    for part in reversed(list(portions(count))):
        state = adjoint(influence[part], slope[part], turn, eigenvalue.imag, step, state, back[part])
        release(influence, slope, back)
    out = room(count) if out is None else out
    r, angle = ratio**-2, frequency * step
    # back swings at n2: its second derivative is -n2^2 of it, and its first is told by a difference
    drag = 2.0 * (-eigenvalue.real * (1.0 - r) - r * damping_difference)
    linear = (step, step * (1.0 - r) * frequency**2, 0.5 * drag * angle / np.sin(angle))
    bend = curve(angle, r / step, deaf)
    for part in portions(count, back, theta, curvature, about, stiffness, out):
        near = slice(max(part.start - BESIDE, 0), min(part.stop + BESIDE, count))
        inner = slice(part.start - near.start, part.stop - near.start)
        here = np.empty(near.stop - near.start)
        through(back[near], theta[near], curvature[near], about[near], stiffness[near], linear, bend, here)
        out[part] = here[inner]
    return out


def curve(turn: float, scale: float, deaf: bool = False) -> tuple[float, float, float, float]:
    """Taps 0, 1, 2, 3 of a symmetric second difference, right at zero and at one, two and three times `turn` rad.

    deaf: at three times it is nought.
    """
    rates = turn * np.arange(4.0)
    matrix = np.stack([np.ones(4), *(2.0 * np.cos(rates * k) for k in (1, 2, 3))], axis=-1)
    wanted = -scale * rates**2
    if deaf:
        wanted[3] = 0.0
    one, two, three, four = np.linalg.solve(matrix, wanted)
    return float(one), float(two), float(three), float(four)
