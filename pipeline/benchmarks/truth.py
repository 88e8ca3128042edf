"""True motion in many digits: closed forms and elliptic functions (mpmath)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from importlib import import_module
from typing import Any

import numpy as np

from pipeline.benchmarks.problems import GRAVITY, Swell
from synth.phase import Floats


def linear(
    frequency: Iterable[float],
    damping: Iterable[float],
    start: Sequence[float],
    swell: Swell,
    instants: Sequence[Fraction],
) -> Floats:
    """Linear pendulums under harmonics, however damped, at resonance too; (instants, pendulums), rad.

    Resonance and critical damping are approached to 1e-40 in 100 digits, which is their limit to 40.
    """
    mpmath: Any = import_module("mpmath")
    mp, mpf, mpc = mpmath.mp, mpmath.mpf, mpmath.mpc
    found = np.empty((len(instants), len(start) // 2))
    with mp.workdps(100):
        for k, (n, each) in enumerate(zip(frequency, damping, strict=True)):
            square, gamma = mpf(float(n)) ** 2 * (1 + mpf(10) ** -40), mpf(float(each))
            root = mp.sqrt(mpc(gamma**2 - square))
            fast, slow = -gamma - root, -gamma + root
            steady = []
            for a, w, p in zip(*swell, strict=True):
                rate = mpf(float(w))
                drive = -(mpf(float(n)) ** 2) * mpf(float(a)) / mpf(GRAVITY) * mp.expj(mpf(float(p)))
                steady.append((rate, drive / (square - rate * rate + mpc(0, 2) * gamma * rate)))
            angle = mpf(float(start[2 * k])) - mp.fsum(c.real for _, c in steady)
            speed = mpf(float(start[2 * k + 1])) - mp.fsum((mpc(0, w) * c).real for w, c in steady)
            one = (speed - slow * angle) / (fast - slow)
            for row, instant in enumerate(instants):
                t = mpf(instant.numerator) / instant.denominator
                free = (one * mp.exp(fast * t) + (angle - one) * mp.exp(slow * t)).real
                found[row, k] = float(free + mp.fsum((c * mp.expj(w * t)).real for w, c in steady))
    return found


def swing(frequency: float, amplitude: float, instants: Sequence[Fraction]) -> Floats:
    """A pendulum released at rest: `sin(theta/2) = k cd(n t, k)`; (instants, 1), rad."""
    mpmath: Any = import_module("mpmath")
    with mpmath.mp.workdps(40):
        modulus, n = mpmath.sin(mpmath.mpf(float(amplitude)) / 2), mpmath.mpf(float(frequency))
        times = [mpmath.mpf(each.numerator) / each.denominator for each in instants]
        values = [2 * mpmath.asin(modulus * mpmath.ellipfun("cd", n * t, m=modulus**2)) for t in times]
        return np.array([[float(value)] for value in values])


def separatrix(frequency: float, instants: Sequence[Fraction]) -> Floats:
    """Through the bottom with 2 n exactly: `4 atan(tanh(n t/2))`, towards the top for ever; (instants, 1), rad."""
    times = np.array([float(each) for each in instants])
    return 4.0 * np.arctan(np.tanh(0.5 * frequency * times))[:, None]
