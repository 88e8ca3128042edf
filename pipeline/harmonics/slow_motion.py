"""The slow motion of the first pendulum, free of its swing, and what it does to the phase speed of a swing.

A support accelerated sideways turns the apparent vertical by psi and strengthens it; heave changes it too. In the slow
limit the swing about psi has the stiffness `n^2 Gamma`,

    Gamma = (1 + zeta) / cos psi + tan psi psi''/n^2

(section 1.2 of the formula sheet). Its phase speed follows from Milne's equation to second order in the modulation,
`n [sqrt(Gamma) - (Gamma'/n)^2/32]`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from pipeline.arrays import Floats
from pipeline.inversion.motion import reach_of, windowed

PASS, STOP = 0.5, 0.85  # of the swing's frequency
REJECTION = 80.0  # dB, of the swing: what is left of it is 1e-6 rad
COARSE = 6.0  # samples a swing that the slow motion needs


@dataclass(frozen=True)
class SlowMotion:
    """psi and zeta at uniform instants.

    Attributes
    ----------
    begin, step : float
        First instant and distance, s.
    angle, curvature : (k,) arrays
        psi, rad; psi'', s-2.
    zeta : (k,) array or None
        z''/g in the same band; None where none is recorded.
    """

    begin: float
    step: float
    angle: Floats
    curvature: Floats
    zeta: Floats | None

    def gamma(self, frequency: float) -> Floats:
        """Gamma at the instants."""
        upright, turned = self._parts
        return np.asarray(upright + turned / frequency**2)

    @cached_property
    def _parts(self) -> tuple[Floats, Floats]:
        """(1 + zeta)/cos psi and tan psi psi''."""
        up = 1.0 if self.zeta is None else 1.0 + self.zeta
        return np.asarray(up / np.cos(self.angle)), np.asarray(np.tan(self.angle) * self.curvature)

    @property
    def end(self) -> float:
        """Last instant, s."""
        return self.begin + self.step * (self.angle.size - 1)

    def phase(self, gamma: Floats, frequency: float, time: Floats) -> Floats:
        """Phase that a swing gains over n t by a given Gamma, rad, at other times; steady beyond the ends."""
        bend = np.gradient(gamma, self.step)
        speed = frequency * (np.sqrt(gamma) - 1.0) - bend**2 / (32.0 * frequency)
        mean = float(speed.mean())
        gained = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) - mean) * self.step))
        own = self.begin + self.step * np.arange(speed.size)
        return np.asarray(np.interp(time, own, gained) + mean * time)


@lru_cache(maxsize=64)
def _taps(step: float, frequency: float) -> tuple[int, Floats | None, Floats, Floats]:
    """How many samples make one coarse one, by what taps (None: by none), and the coarse low-pass and curvature."""
    every = max(1, int(2.0 * np.pi / (frequency * step) / COARSE))
    coarse = every * step
    edge, stop = PASS * frequency, STOP * frequency
    first = None
    if every > 1:
        # what folds onto the pass band must be gone
        reach = reach_of(2.0 * np.pi / coarse - 2.0 * edge, step, REJECTION)
        first = windowed(np.pi / coarse, reach, step, REJECTION)[0]
        first = first / first.sum()
    low, _, bend = windowed(0.5 * (edge + stop), reach_of(stop - edge, coarse, REJECTION), coarse, REJECTION)
    return every, first, low / low.sum(), bend - bend.sum() / low.sum() * low


def slow_motion(theta: Floats, vertical: Floats | None, step: float, frequency: float, gravity: float) -> SlowMotion:
    """Separate the slow motion.

    Parameters
    ----------
    theta : (n,) array
        First pendulum, rad, whole.
    vertical : (n,) array or None
        z'', m s-2.
    step, frequency, gravity : float
        s, rad s-1, m s-2.
    """
    every, first, low, bend = _taps(step, frequency)
    coarse, second = every * step, low.size // 2
    begin = 0.0 if first is None else step * (first.size // 2)

    def filtered(series: Floats, taps: Floats) -> Floats:
        return np.correlate(series, taps, "valid")

    def thinned(series: Floats) -> Floats:
        return series if first is None else filtered(series, first)[::every]

    moved = thinned(theta)
    return SlowMotion(
        begin=begin + coarse * second,
        step=coarse,
        angle=filtered(moved, low),
        curvature=filtered(moved, bend),
        zeta=None if vertical is None else filtered(thinned(vertical), low) / gravity,
    )
