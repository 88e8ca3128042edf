"""The slow motion of the first pendulum, free of its swing, and what it does to the phase speed of a swing.

A support accelerated sideways turns the apparent vertical by psi and strengthens it; heave changes it too. In the slow
limit the swing about psi has the stiffness `n^2 Gamma`,

    Gamma = (1 + zeta) / cos psi + tan psi psi''/n^2

(section 1.2 of the formula sheet). Its phase speed follows from Milne's equation to second order in the modulation,
`n [sqrt(Gamma) - (Gamma'/n)^2/32]`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Floats

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

    @property
    def time(self) -> Floats:
        """The instants, s."""
        return self.begin + self.step * np.arange(self.angle.size)

    def gamma(self, frequency: float) -> Floats:
        """Gamma at the instants."""
        up = 1.0 if self.zeta is None else 1.0 + self.zeta
        return np.asarray(up / np.cos(self.angle) + np.tan(self.angle) * self.curvature / frequency**2)

    def phase(self, frequency: float, time: Floats) -> Floats:
        """Phase that a swing of n = `frequency` gains over n t, rad, at other times; steady beyond the ends."""
        gamma = self.gamma(frequency)
        speed = frequency * (np.sqrt(gamma) - 1.0) - np.gradient(gamma, self.step) ** 2 / (32.0 * frequency)
        mean = float(speed.mean())
        gained = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) - mean) * self.step))
        return np.asarray(np.interp(time, self.time, gained) + mean * time)


def kaiser(count: int, rejection: float) -> Floats:
    """Kaiser's window with that rejection, dB > 50 (Kaiser 1974)."""
    return np.kaiser(count, 0.1102 * (rejection - 8.7))


def reach_of(width: float, step: float, rejection: float) -> int:
    """Half the length, in samples, of a Kaiser window with a transition of `width` rad s-1 (Kaiser 1974)."""
    return int(np.ceil((rejection - 8.0) / (2.285 * width * step) / 2.0))


def windowed(cut: float, reach: int, step: float, rejection: float) -> tuple[Floats, Floats, Floats]:
    """Taps of the low-pass at `cut` rad s-1, of its first derivative (s-1) and of its second (s-2), Kaiser-windowed."""
    time = step * np.arange(-reach, reach + 1, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine, cosine = np.sin(cut * time), np.cos(cut * time)
        low = sine / time
        slope = (cut * cosine - sine / time) / time
        bend = -(cut**2 * sine + 2.0 * cut * cosine / time - 2.0 * sine / time**2) / time
    low[reach], slope[reach], bend[reach] = cut, 0.0, -(cut**3) / 3.0
    window = kaiser(time.size, rejection) * step / np.pi
    return low * window, slope * window, bend * window


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
    every = max(1, int(2.0 * np.pi / (frequency * step) / COARSE))
    edge, stop, coarse = PASS * frequency, STOP * frequency, every * step
    # what folds onto the pass band where samples are left out must be gone
    before = reach_of(2.0 * np.pi / coarse - 2.0 * edge, step, REJECTION)
    first = windowed(np.pi / coarse, before, step, REJECTION)[0]
    after = reach_of(stop - edge, coarse, REJECTION)
    low, _, bend = windowed(0.5 * (edge + stop), after, coarse, REJECTION)

    def filtered(series: Floats, taps: Floats) -> Floats:
        return np.correlate(np.correlate(series, first / first.sum(), "valid")[::every], taps, "valid")

    return SlowMotion(
        begin=before * step + after * coarse,
        step=coarse,
        angle=filtered(theta, low / low.sum()),
        curvature=filtered(theta, bend - bend.sum() / low.sum() * low),
        zeta=None if vertical is None else filtered(vertical, low / low.sum()) / gravity,
    )
