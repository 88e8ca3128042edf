"""The kicks of the splitting, in the frame that swings with the linear pendulum.

The linear, damped and forced pendulum is solved exactly:  theta = psi(t) + Re[c e^{lam (t - t0)}],  lam = -gamma + i w.
In terms of c the exact part of a splitting is no motion at all, and a kick `theta' += b h K` is

    c += (b h K / (i w)) e^{-lam (t - t0)},      K = -n^2 [(1 + zeta) sin theta + u cos theta - theta - u]

so that no rotation is repeated and no rounding piles up; the phases of the frame come from exact phase arithmetic.
"""

from __future__ import annotations

import math

from synth.kernels.compiled import kernel
from synth.phase import Floats, Phasors


@kernel
def kicks(
    frequency: float,
    damped: float,
    weights: Floats,
    frames: Phasors,
    inverses: Phasors,
    forced: Floats,
    across: Floats,
    along: Floats,
    between: int,
    amplitude: Floats,
    out: Phasors,
) -> None:
    """Carry c over many steps.

    Parameters
    ----------
    frequency, damped : float
        n and w = sqrt(n^2 - gamma^2), rad/s.
    weights : (kicks,) array
        b h, s.
    frames, inverses : (steps, kicks) complex arrays
        e^{lam (t - t0)} and e^{-lam (t - t0)} at the kicks.
    forced, across, along : (steps, kicks) arrays
        psi, u and zeta at the kicks.
    between : int
        Steps from one output to the next.
    amplitude : (4,) array
        c, and what rounding left over of it: real, imaginary, real, imaginary; changed in place.
    out : (outputs,) complex array
        Result: c after each `between` steps.
    """  # fmt: skip
    square = frequency * frequency
    real, imaginary, real_low, imaginary_low = amplitude[0], amplitude[1], amplitude[2], amplitude[3]
    for step in range(frames.shape[0]):
        for j in range(weights.size):
            frame = frames[step, j]
            u = across[step, j]
            angle = forced[step, j] + (real * frame.real - imaginary * frame.imag)
            sine = math.sin(angle)
            half = math.sin(0.5 * angle)
            # sin - angle and cos - 1 without cancellation where it would show
            remainder = (sine - angle) + along[step, j] * sine - 2.0 * u * half * half
            push = -square * remainder * weights[j] / damped
            # push / i times the inverse frame
            change = push * inverses[step, j].imag
            other = -push * inverses[step, j].real
            small = real_low + change
            total = real + small
            real_low = small - (total - real)
            real = total
            small = imaginary_low + other
            total = imaginary + small
            imaginary_low = small - (total - imaginary)
            imaginary = total
        if (step + 1) % between == 0:
            out[(step + 1) // between - 1] = complex(real + real_low, imaginary + imaginary_low)
    amplitude[0], amplitude[1], amplitude[2], amplitude[3] = real, imaginary, real_low, imaginary_low
