"""How far collocation may be off, from what it notes on its way.

Three parts, in rad:

- readings are rounded, and so are phases: a few units of the last place of the largest angle;
- r beyond its last Legendre term, extrapolated from the decay of the last two pairs and integrated twice over an
  interval. It does not add up: at Gauss nodes the ends of intervals are right to its square;
- the rounding of r, which adds up like a random walk in the state and then grows. A small arc turns a change of
  amplitude into one of phase by dn/dTheta = -n Theta/8. For a large one growth is measured: a shadow of each pendulum
  starts with a little more energy, as much as rounding of the speed would give it at the lowest point, and the distance
  of the two tells. Energy, because near the separatrix it is the energy that decides what comes next.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from synth.kernels.collocation import NODES
from synth.phase import Floats

LARGE = 0.3
"""Angle from which growth is measured, rad."""
_NUDGE = 1e-13  # error that a shadow starts with, in largest angles: far above rounding, far below any arc
_FARTHEST = 1e-6  # a shadow may start at most this far, in rad: close to rest, energy asks for more
_FAR = 0.1  # of the largest angle: a shadow farther away no longer tells how fast errors grow
_EPSILON = 2.0**-53
_LAST_PLACES = 8.0
_RESOLVED = 2e-14  # of the largest angle: what r beyond its last term may cost


class Estimate:
    """Running estimate for several pendulums (so many without shadows), then their shadows if there are any."""

    def __init__(self, pendulums: int) -> None:
        self.shown = pendulums
        self._amplitude = np.zeros(pendulums)  # of y, squared
        self._peak = np.zeros(pendulums)
        self._beyond = np.zeros(pendulums)
        self._walk = np.zeros(pendulums)  # squared
        self._turned = np.zeros(pendulums)  # n t
        self._nudge = np.zeros(pendulums)
        self._growth = np.ones(pendulums)

    def copy(self) -> Estimate:
        """An independent copy: arrays are replaced, never written to."""
        return copy(self)

    def shadowed(self, other: Estimate) -> Estimate:
        """From here on with shadows; their nudge is a share of the largest angle that `other` saw."""
        result = self.copy()
        result._amplitude = np.tile(self._amplitude, 2)
        result._nudge = _NUDGE * np.minimum(other._peak, np.pi)
        return result

    def nudge(self, state: Floats) -> None:
        """Move the states of shadows, the second half of (pendulums, 4) as in `kernels.picard.march`."""
        for error, shadow in zip(self._nudge.tolist(), state[self.shown :], strict=True):
            uphill = np.array([np.sin(shadow[0]), shadow[2]])
            steepness = float(np.hypot(*uphill))
            energy = error**2 / _NUDGE
            step = min(energy / steepness, _FARTHEST) if steepness > error else error
            direction = uphill / steepness if steepness > error else np.array([0.0, 1.0])
            shadow[[0, 2]] += step * direction

    @property
    def is_large(self) -> bool:
        """Whether growth must be measured."""
        return bool(np.any(self._peak > LARGE))

    def report(self) -> Floats:
        """Fresh report for `kernels.picard.march`."""
        report = np.zeros((len(self._amplitude), 5))
        report[:, 3] = self._amplitude
        return report

    def add(self, report: Floats, steady: Floats, turn: Floats, points: Floats) -> None:
        """Take up what a stride noted, shadows included.

        Its `report` (pendulums, 5); largest angles of the `steady` answers (pendulums,), rad; n h, the `turn` of an
        interval (pendulums,); y at the `points` (pendulums, intervals, POINTS).
        """
        self._amplitude = report[:, 3]
        shown = slice(self.shown)
        last, before = np.sqrt(report[shown, 0]), np.sqrt(report[shown, 1])
        decay = np.divide(last, before, out=np.ones_like(last), where=before > last)
        self._beyond = np.maximum(self._beyond, last * decay * (turn[shown] / (4 * NODES)) ** 2)
        self._walk = self._walk + (_EPSILON * turn[shown]) ** 2 * report[shown, 2] / NODES
        self._turned = self._turned + turn[shown] * points.shape[1]
        self._peak = np.maximum(self._peak, np.sqrt(self._amplitude[shown]) + steady[shown])
        if len(points) > self.shown:
            apart = np.abs(points[self.shown :] - points[shown]).max(axis=(1, 2))
            grown = np.divide(apart, self._nudge, out=np.ones_like(apart), where=self._nudge > 0)
            grown[apart > _FAR * self._peak] *= 10.0  # the distance is bounded, what it stands for is not
            self._growth = np.maximum(self._growth, grown)

    @property
    def is_resolved(self) -> bool:
        """Whether r has been a polynomial of the nodes' degree so far."""
        return bool(np.all(self._beyond <= _RESOLVED * self._peak))

    @property
    def relative(self) -> float:
        """Largest error relative to the largest angle; 2 says that nothing is known."""
        arc = 1.0 + self._turned * np.minimum(self._amplitude[: self.shown], LARGE**2) / 8
        walk = np.sqrt(self._walk) * np.maximum(self._growth, arc)
        error = _LAST_PLACES * _EPSILON * self._peak + self._beyond + walk
        share = np.divide(error, self._peak, out=np.zeros_like(error), where=self._peak > 0)
        return min(float(np.max(share, initial=0.0)), 2.0)
