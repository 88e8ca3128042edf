"""How white noise of the first pendulum's trace reaches n2, by the adjoint of the nonlinear identity."""

from __future__ import annotations

import numpy as np

from data_schemas.scratch import portions, release, room
from pipeline.arrays import Floats
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.kernels import adjoint

BESIDE = 3  # samples on both sides that the taps of a second difference reach


def theta_influence(
    iteration: Iteration, influence: Floats, pull: float, ratio: float, damping_difference: float
) -> Floats:
    """d n2 / d theta1 at every sample, s-1.

    Parameters
    ----------
    iteration : Iteration
        Settled.
    influence : (m,) array
        d n2 / d (sample of the difference), s-1.
    pull : float
        Gravity of the fitted n2, m s-2.
    ratio, damping_difference : float
        n1/n2; gamma1 - gamma2, s-1.
    """
    motion, step, frequency, eigenvalue = iteration.motion, iteration.step, iteration.frequency, iteration.eigenvalue
    count = influence.size
    back, out = room(count), room(count)
    turn, state = complex(np.exp(eigenvalue * step)), 0.0j
    for part in reversed(list(portions(count))):
        state = adjoint(influence[part], iteration.slope[part], turn, eigenvalue.imag, step, state, back[part])
        release(influence, iteration.slope, back)
    r, angle = ratio**-2, frequency * step
    # back swings at n2: its second derivative is -n2^2 of it, and its first is a difference of its neighbours
    drag = 2.0 * (-eigenvalue.real * (1.0 - r) - r * damping_difference)
    straight, turned = step * (1.0 - r) * frequency**2, 0.5 * drag * angle / np.sin(angle)
    bent_taps = second_difference(angle, r / step, motion.third)
    for part in portions(count, back, iteration.about, out, *motion.arrays):
        near = slice(max(part.start - BESIDE, 0), min(part.stop + BESIDE, count))
        left, right = BESIDE - (part.start - near.start), BESIDE - (near.stop - part.stop)
        b, d, t = back[near], iteration.about[near], motion.low[near]
        secant, sine = 1.0 / np.cos(t), np.sin(d)
        tangent = np.sin(t) * secant
        lever = (frequency**2 * motion.pull(pull, near) * tangent + motion.bend[near] * secant) * secant * sine
        bent = np.pad((tangent * sine - 2.0 * np.sin(0.5 * d) ** 2) * b, (left, right))
        wide = np.pad((straight + step * lever) * b, (left, right))
        out[part] = wide[BESIDE:-BESIDE] + np.correlate(bent, bent_taps, "valid")
        b = np.pad(b, (left, right))
        out[part] += turned * (b[BESIDE + 1 : 1 - BESIDE] - b[BESIDE - 1 : -BESIDE - 1])
    return out


def second_difference(turn: float, scale: float, notch: bool = False) -> Floats:
    """Seven symmetric taps of `scale d^2`, right at zero and at one, two and three times `turn` rad.

    notch: at three times it is zero.
    """
    rates = turn * np.arange(4.0)
    matrix = np.stack([np.ones(4), *(2.0 * np.cos(rates * k) for k in (1, 2, 3))], axis=-1)
    wanted = -scale * rates**2
    if notch:
        wanted[3] = 0.0
    half = np.linalg.solve(matrix, wanted)
    return np.concatenate([half[:0:-1], half])
