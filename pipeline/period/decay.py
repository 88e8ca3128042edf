"""What brakes a single pendulum, from its turning points: the energy that a half swing of amplitude A loses,

    sin A dA = 2 (gamma/n) int sqrt(2 (cos x - cos A)) dx + c int 2 (cos x - cos A) dx + 2 delta A,    delta = f/n^2

of viscous, quadratic (turbulent air) and dry (knife edge) friction, which at small arcs is
`dA = pi (gamma/n) A + (4/3) c A^2 + 2 delta`; by least squares, each only where the likelihood pays for it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Floats

LAWS = ("viscous", "quadratic", "knife-edge")


@dataclass(frozen=True)
class Decay:
    """Friction of one pendulum.

    Attributes
    ----------
    damping_rate : float
        gamma, s-1.
    quadratic : float
        c of theta'' = -c |theta'| theta'.
    dry : float
        delta, rad: by so much the middle of a half swing lies behind the rest.
    """

    damping_rate: float
    quadratic: float
    dry: float

    @property
    def words(self) -> str:
        """The laws that pay, or that nothing brakes."""
        found = [law for law, size in zip(LAWS, (self.damping_rate, self.quadratic, self.dry), strict=True) if size]
        return ", ".join(found) or "none"


def decay(time: Floats, amplitude: Floats, smooth: Floats, period: float) -> Decay:
    """Laws of friction by the likelihood of the turning points.

    Parameters
    ----------
    time, amplitude, smooth : (m,) arrays
        Of successive turning points, s and rad; the amplitude smoothed, from which losses follow.
    period : float
        s.
    """
    from scipy.optimize import nnls

    middle = 0.5 * (smooth[1:] + smooth[:-1])
    swings = np.maximum(1.0, np.rint(2.0 * np.diff(time) / period))  # in a gap there are more
    losses = swings[:, None] * _losses(np.clip(middle, 1e-9, 3.1))
    # the first amplitude less what is lost since
    lost = -np.concatenate([np.zeros((1, 3)), np.cumsum(losses, axis=0)])
    best, found = np.inf, np.zeros(3)
    for count in range(4):
        for some in itertools.combinations(range(3), count):
            matrix = np.concatenate([np.ones((amplitude.size, 1)), lost[:, some]], axis=1)
            size = np.linalg.norm(matrix, axis=0)
            solution, rest = nnls(matrix / size, amplitude)
            noise = max(rest, 1e-12 * float(amplitude.max())) / np.sqrt(amplitude.size)
            price = amplitude.size * np.log(noise) + 0.5 * count * np.log(amplitude.size)
            if price < best:
                best, found = price, np.zeros(3)
                found[list(some)] = solution[1:] / size[1:]
    viscous, quadratic, dry = found.tolist()
    return Decay(2.0 * np.pi / period * viscous, quadratic, dry)


def _losses(amplitude: Floats) -> Floats:
    """Of amplitude in a half swing, (m, 3), for gamma/n, c and delta of one."""
    point, weight = np.polynomial.legendre.leggauss(24)
    turn = 0.5 * np.pi * point  # x = A sin(turn), where the root is smooth
    across = amplitude[:, None] * np.sin(turn)
    root = np.sqrt(np.maximum(2.0 * (np.cos(across) - np.cos(amplitude)[:, None]), 0.0))
    viscous = 2.0 * (root * np.cos(turn)) @ weight * 0.5 * np.pi * amplitude
    quadratic = 4.0 * (np.sin(amplitude) - amplitude * np.cos(amplitude))
    return np.stack([viscous, quadratic, 2.0 * amplitude], axis=1) / np.sin(amplitude)[:, None]
