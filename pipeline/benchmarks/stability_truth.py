"""Truth for the extreme motions: closed forms and elliptic functions in many digits, published figures."""

from __future__ import annotations

from fractions import Fraction
from importlib import import_module
from typing import Any

import numpy as np

from pipeline.benchmarks.plain_pendulums import Swell
from synth.phase import Floats

ANOTHER = "another propagator, tighter"
"""Source of cases without a closed form: every propagator is held against a different one."""

MOST = 400
"""Readings of which truth is made; NaN elsewhere, which is not compared."""

VAN_DER_POL = (
    (1e-8, 100, 1.7246377432770145),
    (1.0, 100, 2.0049420104110018),
    (1e3, 2000, 1.7061677321704650),
    (1e4, 2000, 1.8582056668151835),
)
"""mu, t, y(t) from (2, 0): 80-bit Taylor integration at 1e-18 (heyoka 7.13)."""

MATHIEU = (
    ("inside the first tongue", 1.0, 0.1, -2.0246669154159473),
    ("far inside", 1.0, 1.0, -4.396667734798867),
    ("violently", 1.0, 5.0, -22.780286845153743),
    ("outside, above the tongue", 1.2, 0.1, -1.9319327479945316),
    ("outside", 2.5, 0.1, 0.4979022045412337),
)
"""Where, a, q, trace over pi of `y'' + (a - 2 q cos 2t) y = 0`: Taylor series in 30 digits (mpmath 1.3)."""


def _mpmath() -> Any:
    return import_module("mpmath")


def rows(count: int) -> Floats:
    """Readings of which truth is made."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(np.int64))


def linear(
    frequency: tuple[float, ...],
    damping: float,
    start: tuple[float, ...],
    swell: Swell,
    gravity: float,
    step: Fraction,
    count: int,
) -> Floats:
    """Linear pendulums under harmonics, however damped, at resonance too; (count, pendulums), rad.

    Resonance and critical damping are approached to 1e-40 in 100 digits, which is their limit to 40.
    """
    mpmath = _mpmath()
    mp, mpf = mpmath.mp, mpmath.mpf
    found = np.full((count, len(frequency)), np.nan)
    with mp.workdps(100):
        for k, n in enumerate(frequency):
            square, gamma = mpf(n) ** 2 * (1 + mpf(10) ** -40), mpf(damping)
            root = mp.sqrt(mpmath.mpc(gamma**2 - square))
            fast, slow = -gamma - root, -gamma + root
            steady = [
                (mpf(float(w)), -(mpf(n) ** 2) * mpf(float(a)) / mpf(gravity) * mp.expj(mpf(float(p))))
                for a, w, p in zip(*swell, strict=True)
            ]
            steady = [(w, f / (square - w * w + mpmath.mpc(0, 2) * gamma * w)) for w, f in steady]
            angle = mpf(start[2 * k]) - mp.fsum(c.real for _, c in steady)
            rate = mpf(start[2 * k + 1]) - mp.fsum((mpmath.mpc(0, w) * c).real for w, c in steady)
            one = (rate - slow * angle) / (fast - slow)
            other = angle - one
            for row in rows(count).tolist():
                t = mpf(step.numerator) * row / step.denominator
                free = (one * mp.exp(fast * t) + other * mp.exp(slow * t)).real
                found[row, k] = float(free + mp.fsum((c * mp.expj(w * t)).real for w, c in steady))
    return found


def swing(frequency: float, amplitude: float, step: Fraction, count: int) -> Floats:
    """Released at rest: `sin(theta/2) = k cd(n t, k)`; (count, 1), rad."""
    mpmath = _mpmath()
    found = np.full((count, 1), np.nan)
    with mpmath.mp.workdps(40):
        modulus, n = mpmath.sin(mpmath.mpf(float(amplitude)) / 2), mpmath.mpf(float(frequency))
        for row in rows(count).tolist():
            t = mpmath.mpf(step.numerator) * row / step.denominator
            found[row, 0] = float(2 * mpmath.asin(modulus * mpmath.ellipfun("cd", n * t, m=modulus**2)))
    return found


def inverted(frequency: float, angle: float, step: Fraction, count: int) -> Floats:
    """Released at rest where gravity is turned over: a swing about the upper vertical; (count, 1), rad."""
    found: Floats = np.pi - swing(frequency, float(np.pi) - angle, step, count)
    return found


def straight(angle: float, rate: float, step: Fraction, count: int) -> Floats:
    """Nothing pulls; (count, 1), rad."""
    return np.array([[angle + rate * float(step * k)] for k in range(count)])


def rotation(frequency: float, rate: float, step: Fraction, count: int) -> Floats:
    """Through the bottom faster than 2 n: `theta = 2 am(rate t/2, 2 n/rate)`, counted on; (count, 1), rad."""
    mpmath = _mpmath()
    halves = []
    with mpmath.mp.workdps(40):
        n, speed = mpmath.mpf(float(frequency)), mpmath.mpf(float(rate))
        square = (2 * n / speed) ** 2
        for row in range(count):
            u = speed / 2 * row * step.numerator / step.denominator
            sine, cosine = (mpmath.ellipfun(name, u, m=square) for name in ("sn", "cn"))
            halves.append(float(mpmath.atan2(sine, cosine)))
    return 2.0 * np.unwrap(np.array(halves))[:, None]


def separatrix(frequency: float, step: Fraction, count: int) -> Floats:
    """Through the bottom with 2 n exactly: `4 atan(tanh(n t/2))`, towards the top for ever; (count, 1), rad."""
    times = np.array([float(step * k) for k in range(count)])
    return 4.0 * np.arctan(np.tanh(0.5 * frequency * times))[:, None]
