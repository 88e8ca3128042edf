r"""A linear pendulum on a moving support, in closed form.

    theta'' + 2 gamma theta' + n^2 theta = -n^2 u,   u = x''/g = Re sum U_k exp(i w_k t)         (P 1)

with lambda = -gamma + i omega, omega^2 = n^2 - gamma^2. A harmonic away from n is answered by the steady

    -n^2 U / ((n - w)(n + w) + 2 i gamma w) * exp(i w t)

which belongs to the slow part psi. A harmonic m close to n is answered by a beat that starts from zero,

    G (exp(i m t) - exp(lambda t)) / mu,   mu = i m - lambda,   G = -n^2 U / (i m - conj(lambda))   (P 30, 31)

and belongs to the free harmonic: at gamma = 0 it is beta sin(nu t) sin((n - nu) t + delta) with the sign of
beta corrected, and at exact resonance (mu = 0) it is G t exp(lambda t). So theta = Re Z + psi with

    Z = Z(0) exp(lambda t) + sum of beats

in which Re Z + psi satisfies the equation of motion exactly.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene_pendulum import FreeStart, Start
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats, Phasors, damped_frequency
from synth.propagators.blocks import PeriodicSums

NEAR_RESONANT_BAND = (0.8, 1.25)
"""Harmonics between these multiples of n count to the free harmonic, all others to the slow part."""

_APART = 8.0  # of |mu| times the period of a comb: beats that turn more lose nothing as two harmonics


@dataclass(frozen=True)
class Response:
    """Motion of one pendulum, as coefficients of known functions of time."""

    frequency: float
    damping_rate: float  # n in rad/s, gamma in 1/s
    damped_frequency: Fraction  # omega in rad/s, beyond double precision
    start: complex  # Z(0), rad
    forced: Phasors  # (harmonics,) coefficient of exp(i w t) in psi, rad; zero for near-resonant harmonics
    near: NDArray[np.int64]  # (beats,) which harmonics are near-resonant
    gain: Phasors  # (beats,) G, rad/s
    split: Phasors  # (beats,) mu = i m - lambda, rad/s; exact in the difference of the two frequencies
    motion: HarmonicSum  # What it answers

    @cached_property
    def is_transformed(self) -> NDArray[np.bool_]:
        """Which beats are summed by transform, as harmonics apart, (beats,); others of a comb turn too little."""
        result = np.zeros(self.near.size, dtype=np.bool_)
        for comb in self.motion.combs:
            within = (self.near >= comb.span.start) & (self.near < comb.span.stop)
            result |= within & (np.abs(self.split) * float(comb.period) >= _APART)
        return result

    @cached_property
    def transforms(self) -> tuple[PeriodicSums, ...]:
        """Answer to every comb: one sum."""
        return tuple(comb.sums(self.forced + self._beats) for comb in self.motion.combs)

    @cached_property
    def beat_transforms(self) -> tuple[PeriodicSums, ...]:
        """Beats of every comb that has any: two sums, real and imaginary part."""
        beats = self._beats
        return tuple(comb.sums(beats, -1j * beats) for comb in self.motion.combs if beats[comb.span].any())

    @cached_property
    def _beats(self) -> Phasors:
        """Harmonics of the beats that are summed by transform, (harmonics,)."""
        picked = self.is_transformed
        result = np.zeros_like(self.forced)
        result[self.near[picked]] = self.gain[picked] / self.split[picked]
        return result


def respond(frequency: float, damping_rate: float, start: Start, motion: HarmonicSum, gravity: float) -> Response:
    """Answer of a linear pendulum, n > gamma >= 0, with its state at t = 0, to a horizontal acceleration; SI units."""
    omega = damped_frequency(frequency, damping_rate)
    w = motion.angular_frequency
    force = motion.acceleration * (-(frequency**2) / gravity)  # -n^2 U
    low, high = NEAR_RESONANT_BAND
    near = np.flatnonzero((w > low * frequency) & (w < high * frequency))
    stiffness = (frequency - w) * (frequency + w) + 2j * damping_rate * w
    stiffness[near] = 1.0
    forced = force / stiffness
    forced[near] = 0.0
    m, nearest = w[near], float(omega)
    gain = force[near] / (damping_rate + 1j * (m + nearest))
    apart = (m - nearest) + (motion.rest(near) - float(omega - Fraction(nearest)))  # the first difference is exact
    split = np.full(near.size, damping_rate, dtype=np.complex128)
    split.imag = apart
    if isinstance(start, FreeStart):
        free = start.amplitude * complex(np.exp(1j * start.phase))
    else:
        # Beats start from zero with the velocity Re G; psi starts from its own state.
        angle = start.angle - float(forced.real.sum())
        speed = start.angular_velocity + float((w * forced.imag).sum()) - float(gain.real.sum())
        free = complex(angle, -(speed + damping_rate * angle) / nearest)
    return Response(frequency, damping_rate, omega, free, forced, near, gain, split, motion)


def start_state(response: Response) -> Floats:
    """Angle and rate at t = 0, (2,) rad and rad/s: the free harmonic on top of psi (physics sheet, 1.2)."""
    own = complex(-response.damping_rate, float(response.damped_frequency))
    slow = np.array([np.sum(response.forced), np.sum(1j * response.motion.angular_frequency * response.forced)])
    free = np.array([response.start, own * response.start + np.sum(response.gain)])
    return np.asarray((slow + free).real)
