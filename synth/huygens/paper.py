"""The paper's closed chain (10)-(14) for its synchronous regime: as printed, and with what it neglects.

alpha_1 = alpha_2 = alpha is given, then beta, q, Delta, tau and k = d eta/d chi follow one from the other. Delta, beta
and tau are small; delta0 = eps0/w and delta = 2 eps/w are numbers at the regime's own frequency.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.phase import Floats

DAMPING, COUPLING = 0.02, 0.4 / 7000.0
"""delta0 and nu of the paper's Fig. 2; nu follows from its range 175 < k, as k(pi/4) = delta0/(2 nu)."""


class Chain(NamedTuple):
    """The regime, number by number; arrays of the shape of alpha."""

    alpha: Floats  # rad
    beta: Floats  # w0^2/w^2 - 1
    q: Floats  # 2X/l
    tau: Floats  # 4 w_i^2/w0^2 - 1, mean
    slope: Floats  # k = d eta/d chi
    amplitude: Floats  # A of y = A cos(z - alpha)
    growth: Floats  # -q sin 2 alpha: rate per z at which an antisymmetric perturbation grows in system (2)


def printed(alpha: ArrayLike, damping: float = DAMPING, coupling: float = COUPLING) -> Chain:
    """(10)-(14) as the paper has them: A = 2, and k without the escapement.

    alpha lies in (-pi/2, 0), rad (else delta0 q = -nu sin 2 alpha cannot hold: `UsageError`); damping and coupling are
    delta0 and nu = 8 mu/l (which the paper prints as 32 mu/l).
    """
    return _chain(alpha, damping, coupling, math.inf, 0.0)


def corrected(alpha: ArrayLike, drive: float, damping: float = DAMPING, coupling: float = COUPLING) -> Chain:
    """(10)-(14) from the six equations (7)-(8): A^2/4 = G, and k with its second term.

    G = 1/(1 + nu sin^2 2 alpha/(delta delta0)), q = -(nu/delta0) G sin 2 alpha, beta = -delta0 cot 2 alpha,
    k = (1 + beta) [delta0/(2 nu sin^2 2 alpha) + 1/(2 delta)]. tau is that of the true Delta, which is larger by
    delta^2/8 than the balance's: van der Pol's own shift. The drive is delta = 2 eps/w (which the paper prints with the
    dimension of a length), the others are as for `printed`.
    """
    if not drive > 0.0:
        raise UsageError(f"drive = {drive:g}: delta = 2 eps/w lies above 0")
    return _chain(alpha, damping, coupling, drive, drive**2 / 8.0)


def _chain(alpha: ArrayLike, damping: float, coupling: float, drive: float, shift: float) -> Chain:
    """The chain; without the escapement, which (10)-(14) leave out, its drive is infinite and shifts nothing."""
    angle = np.asarray(alpha, dtype=np.float64)
    if not (damping > 0.0 and coupling > 0.0):
        raise UsageError(f"damping = {damping:g}, coupling = {coupling:g}: both delta0 and nu lie above 0")
    if not np.all((angle > -0.5 * math.pi) & (angle < 0.0)):
        raise UsageError("alpha: (8) holds for a damped beam only where sin 2 alpha < 0; give -pi/2 < alpha < 0")
    sine, cosine = np.sin(2.0 * angle), np.cos(2.0 * angle)
    gain = 1.0 / (1.0 + coupling * sine**2 / (drive * damping))
    beta = -damping * cosine / sine  # (14)
    q = -(coupling / damping) * gain * sine  # (14)
    tau = (1.0 + shift + q * cosine) / (1.0 + beta) - 1.0  # (13): Delta = beta + tau + beta tau
    slope = (1.0 + beta) * (damping / (2.0 * coupling * sine**2) + 1.0 / (2.0 * drive))  # (12)
    return Chain(angle, beta, q, tau, slope, 2.0 * np.sqrt(gain), -q * sine)
