"""One hour of two linear pendulums under 33 harmonics, 20 readings a second: the scene of the propagators' race."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene_motion import HarmonicMotion
from data_schemas.scene_pendulum import StateStart
from pipeline.arrays import Floats
from synth.motion.harmonic_sum import HarmonicSum
from synth.motion.harmonics import harmonics
from synth.pendulums.linear import respond
from synth.propagators.even import EvenTimes

RATE = 20  # readings a second
HARMONICS = 33
HOUR = 3600  # s
GRAVITY = 9.81


@dataclass(frozen=True)
class Task:
    """theta'' + 2 gamma theta' + n^2 theta = -(n^2/g) sum a cos(w t + phase), two pendulums.

    Attributes
    ----------
    frequency, damping_rate, angle, speed : (2,) arrays
        n, gamma, and the start, of each pendulum.
    amplitude, rate, phase : (33,) arrays
        a in m s-2, w in rad s-1, rad.
    seconds : int
        Length.
    """

    frequency: Floats
    damping_rate: Floats
    angle: Floats
    speed: Floats
    amplitude: Floats
    rate: Floats
    phase: Floats
    seconds: int

    @property
    def time(self) -> Floats:
        """The readings, s."""
        return np.arange(self.seconds * RATE) / RATE


def task(seconds: int = HOUR) -> Task:
    """Swell of 4 to 20 s and one harmonic near the pendulums' own frequency."""
    chance = np.random.default_rng(33)
    frequency = 2.0 * np.pi / np.array([1.0099, 1.01])
    rate = 2.0 * np.pi / chance.uniform(4.0, 20.0, HARMONICS)
    rate[-1] = frequency[0] - 2.0 * 0.026
    amplitude = np.full(HARMONICS, 0.03)
    amplitude[-1] = 4e-4
    return Task(
        frequency=frequency,
        damping_rate=np.array([1e-4, 1.2e-4]),
        angle=np.array([0.015, -0.01]),
        speed=np.array([0.03, 0.05]),
        amplitude=amplitude,
        rate=rate,
        phase=chance.uniform(0.0, 2.0 * np.pi, HARMONICS),
        seconds=seconds,
    )


def motion(given: Task) -> HarmonicSum:
    """The support's motion as the simulator holds it."""
    return harmonics(
        HarmonicMotion(
            amplitude=tuple(given.amplitude.tolist()),
            angular_frequency=tuple(given.rate.tolist()),
            phase=tuple(given.phase.tolist()),
        )
    )


def closed_form(given: Task, moved: HarmonicSum | None = None) -> Floats:
    """The simulator's own propagator, from numbers to angles, (2, n); `moved` saves checking the numbers anew."""
    moved = motion(given) if moved is None else moved
    pendulums = zip(given.frequency, given.damping_rate, given.angle, given.speed, strict=True)
    responses = [
        respond(float(n), float(gamma), StateStart(angle=float(angle), angular_velocity=float(speed)), moved, GRAVITY)
        for n, gamma, angle, speed in pendulums
    ]
    return EvenTimes(Fraction(1, RATE), given.seconds * RATE).elongation(responses, moved.angular_frequency)


def reference(given: Task, rows: NDArray[np.int64], *, rounded: bool = False) -> Floats:
    """Angles at some readings in 40 digits: steady answer of every harmonic, the rest by the start; (2, rows).

    `rounded`: at the instants as doubles, 1e-13 s off within an hour, which is what general integrators are told.
    """
    mpmath: Any = import_module("mpmath")
    mp, mpc, mpf = mpmath.mp, mpmath.mpc, mpmath.mpf
    out = np.empty((2, rows.size))
    with mp.workdps(40):
        pendulums = zip(given.frequency, given.damping_rate, given.angle, given.speed, strict=True)
        for k, numbers in enumerate(pendulums):
            n, gamma, angle, speed = (mpf(float(each)) for each in numbers)
            lam = mpc(-gamma, mp.sqrt(n * n - gamma * gamma))
            steady = []
            for a, w, p in zip(given.amplitude, given.rate, given.phase, strict=True):
                rate = mpf(float(w))
                drive = -(n * n) * mpf(float(a)) / mpf(str(GRAVITY)) * mp.expj(mpf(float(p)))
                steady.append((rate, drive / (n * n - rate * rate + mpc(0, 2) * gamma * rate)))
            left = angle - mp.fsum(mp.re(c) for _, c in steady)
            rising = speed - mp.fsum(mp.re(mpc(0, w) * c) for w, c in steady)
            free = mpc(left, -(rising + gamma * left) / lam.imag)
            for j, row in enumerate(rows):
                t = mpf(float(given.time[row])) if rounded else mpf(int(row)) / RATE
                value = mp.re(free * mp.exp(lam * t)) + mp.fsum(mp.re(c * mp.expj(w * t)) for w, c in steady)
                out[k, j] = float(value)
    return out
