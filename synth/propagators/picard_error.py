"""How far collocation may be off, from what it notes on its way.

Three parts, in rad:

- readings are rounded, and so are phases: a few units of the last place of the largest angle;
- r beyond its last Legendre term, extrapolated from the decay of the last two pairs, integrated twice over an
  interval. It does not add up: at Gauss nodes the ends of intervals are right to the square of it;
- the rounding of r, which adds up like a random walk, and whose amplitude shifts the phase by dn/dTheta = -n Theta/8.

A pendulum in parametric resonance or near its separatrix amplifies every error, also the last bit of its start, and no
local estimate sees it.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from synth.kernels.collocation import NODES
from synth.phase import Floats

_EPSILON = 2.0**-53
_LAST_PLACES = 8.0
_RESOLVED = 2e-14  # of the largest angle: what r beyond its last term may cost


class Estimate:
    """Running estimate for several pendulums.

    Parameters
    ----------
    frequencies : (pendulums,)
        n, rad/s
    """

    def __init__(self, frequencies: Floats) -> None:
        self._amplitude = np.zeros(len(frequencies))  # of y, squared
        self._peak = np.zeros(len(frequencies))
        self._beyond = np.zeros(len(frequencies))
        self._walk = np.zeros(len(frequencies))
        self._turned = np.zeros(len(frequencies))  # n t

    def copy(self) -> Estimate:
        """An independent copy: its arrays are replaced, never written to."""
        return copy(self)

    def report(self) -> Floats:
        """Fresh report for `kernels.collocation.march`."""
        report = np.zeros((len(self._peak), 5))
        report[:, 3] = self._amplitude
        return report

    def add(self, report: Floats, steady: Floats, turn: Floats, intervals: int) -> None:
        """Take up what the march noted.

        Parameters
        ----------
        report : (pendulums, 5)
            As `march` leaves it.
        steady : (pendulums,)
            Largest steady angle, rad.
        turn : (pendulums,)
            n h
        intervals : int
            How many were done.
        """
        last, before = np.sqrt(report[:, 0]), np.sqrt(report[:, 1])
        decay = np.divide(last, before, out=np.ones_like(last), where=before > last)
        self._beyond = np.maximum(self._beyond, last * decay * (turn / (4 * NODES)) ** 2)
        self._walk = self._walk + (_EPSILON * turn) ** 2 * report[:, 2] / NODES
        self._turned = self._turned + turn * intervals
        self._amplitude = report[:, 3]
        self._peak = np.maximum(self._peak, np.sqrt(self._amplitude) + steady)

    @property
    def is_resolved(self) -> bool:
        """Whether r has been a polynomial of the nodes' degree so far."""
        return bool(np.all(self._beyond <= _RESOLVED * self._peak))

    @property
    def relative(self) -> float:
        """Largest error relative to the largest angle."""
        arc = np.minimum(np.sqrt(self._amplitude), 3.1)
        growth = 1.0 + self._turned * arc**2 / 8 / np.cos(arc / 2) ** 2
        error = _LAST_PLACES * _EPSILON * self._peak + self._beyond + np.sqrt(self._walk) * growth
        return float(np.max(np.divide(error, self._peak, out=np.zeros_like(error), where=self._peak > 0), initial=0.0))
