"""A random ship and pendulums on it, integrated by extrapolation; shares no numerics with the simulator.

    theta'' = -2 gamma theta' - q |theta'| theta' - f theta'/hypot(theta', v)
              - (1/l) [(g(t) + z'') sin theta + x'' cos theta]

Each step is Gragg's modified midpoint rule with 2, 4, 6, 8 and 10 substeps, extrapolated to order 10 (Hairer, Norsett
and Wanner, Solving Ordinary Differential Equations I, II.9).
"""

import math
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Complexes, Floats
from synth.kernels.compiled import kernel, making_kernel

_HARMONICS = 48
_LOW, _HIGH = 0.6, 2.6
"""Of the peak's frequency: below there is nothing; depth, or a hull longer than the waves, cuts above."""
_PEAK_FACTOR = 3.3  # Hasselmann and others, JONSWAP, 1973
_HULL = 0.5  # rad: how far from 90 degrees a hull turns sway against heave
LONGEST = 0.05
"""s; the longest step: a third of a radian of a one-second pendulum, which errs by 1e-11 rad in five minutes."""
_KINKED = 0.01  # s, the longest step where a drag has a kink at each turn of the swing
_RATE = 1e-2  # rad/s, below which knife-edge friction fades: a tenth of the swing's speed
_RAMP = 5.0  # s, in which the ship's rate of turn or thrust changes
_SUBSTEPS = np.array([2, 4, 6, 8, 10])
_GRID = 120  # the least common multiple of the substeps: a node is a whole number of 1/120 of a step
_NODES = np.array(sorted({m * _GRID // n for n in (2, 4, 6, 8, 10) for m in range(n)}))
_PLACE = np.searchsorted(_NODES, np.arange(_GRID))


class Motion(NamedTuple):
    """Accelerations of the support, Re sum (amplitude e^{i rate t}), m/s^2."""

    rate: Floats  # rad/s, (harmonics,)
    across: Complexes  # x'', (harmonics,)
    along: Complexes  # z'', up positive, (harmonics,)


def sea(random: np.random.Generator, period: float, across: float, along: float) -> Motion:
    """A sea of given peak period, s, with harmonics at random frequencies, amplitudes and phases; `across` and `along`:
    rms of x'' and z'', m/s^2. Particles move in circles, x'' a quarter of a swing from z'', but for what a hull adds to
    each harmonic."""
    edges = np.linspace(_LOW, _HIGH, _HARMONICS + 1) / period
    frequency = random.uniform(edges[:-1], edges[1:])
    width = np.where(frequency <= 1.0 / period, 0.07, 0.09)
    bump = _PEAK_FACTOR ** np.exp(-0.5 * ((frequency * period - 1.0) / width) ** 2)
    spectrum = frequency**-5.0 * np.exp(-1.25 * (frequency * period) ** -4.0) * bump  # of the elevation: JONSWAP
    # the acceleration's spectrum is w^4 times the elevation's; Rayleigh amplitudes make a Gaussian sea
    size = np.sqrt(spectrum) * frequency**2 * random.rayleigh(size=_HARMONICS)
    size /= math.sqrt(0.5 * float(np.sum(size**2)))
    phase = random.uniform(0.0, 2.0 * math.pi, _HARMONICS)
    turned = phase + random.choice([-1, 1]) * 0.5 * math.pi + random.uniform(-_HULL, _HULL, _HARMONICS)
    return Motion(2.0 * math.pi * frequency, across * size * np.exp(1j * turned), along * size * np.exp(1j * phase))


def line(random: np.random.Generator, frequency: float, across: float, along: float) -> Motion:
    """One harmonic of given frequency in Hz and amplitudes in m/s^2, of random phases."""
    phases = np.exp(1j * random.uniform(0.0, 2.0 * math.pi, 2))
    return Motion(np.array([2.0 * math.pi * frequency]), across * phases[:1], along * phases[1:])


def at(times: Floats, rate: Floats, amplitude: Complexes) -> Floats:
    """The acceleration at given times."""
    out = np.zeros(times.size)
    for speed, size in zip(rate, amplitude, strict=True):
        out += (size * np.exp(1j * speed * times)).real
    return out


class Support(NamedTuple):
    """What moves and attracts the pendulums; x'' = Re sum (across e^{i rate t}), z'' likewise by `along`."""

    rate: Floats  # rad/s, (harmonics,)
    across: Complexes
    along: Complexes  # m/s^2, (harmonics,)
    pulses: Floats  # (pulses, 3): begin s, end s, and x'' m/s^2 between
    gravity: Floats
    """(6,): value m/s^2, slope m/s^3, time s where the slope's part is zero, and a wave: m/s^2, rad/s, rad."""


class Pendulums(NamedTuple):
    """Each (pendulums,)."""

    length: Floats  # m, reduced
    damping: Floats  # 1/s
    quadratic: Floats  # 1/rad
    friction: Floats  # rad/s^2, of the knife edge
    linear: bool  # the limit of small angles, which ignores z''


@kernel
def gravity_at(time: float, law: Floats) -> float:
    """Gravity at a time, m/s^2."""
    return float(law[0] + law[1] * (time - law[2]) + law[3] * math.sin(law[4] * time + law[5]))


@kernel
def _support_at(time: float, support: Support) -> tuple[float, float]:
    """Horizontal acceleration, and gravity with the vertical one."""
    across, along = 0.0, gravity_at(time, support.gravity)
    for k in range(support.rate.size):
        cosine, sine = math.cos(support.rate[k] * time), math.sin(support.rate[k] * time)
        across += support.across[k].real * cosine - support.across[k].imag * sine
        along += support.along[k].real * cosine - support.along[k].imag * sine
    for k in range(support.pulses.shape[0]):
        begin, end = support.pulses[k, 0], support.pulses[k, 1]
        across += 0.5 * support.pulses[k, 2] * (math.tanh((time - begin) / _RAMP) - math.tanh((time - end) / _RAMP))
    return across, along


@kernel
def _acceleration(angle: float, speed: float, across: float, along: float, i: int, own: Pendulums) -> float:
    torque = along * angle + across if own.linear else along * math.sin(angle) + across * math.cos(angle)
    drag = 2.0 * own.damping[i] * speed + own.quadratic[i] * abs(speed) * speed
    if own.friction[i] > 0.0:
        drag += own.friction[i] * speed / math.sqrt(speed * speed + _RATE * _RATE)
    return float(-drag - torque / own.length[i])


@kernel
def _step(state: Floats, i: int, step: float, across: Floats, along: Floats, own: Pendulums, table: Floats) -> None:
    """One extrapolated step of pendulum i, in place."""
    for row in range(_SUBSTEPS.size):
        count = _SUBSTEPS[row]
        part = step / count
        angle, speed = state[i, 0], state[i, 1]
        next_angle = angle + part * speed
        next_speed = speed + part * _acceleration(angle, speed, across[0], along[0], i, own)
        for m in range(1, count):
            at = _PLACE[m * _GRID // count]
            pull = _acceleration(next_angle, next_speed, across[at], along[at], i, own)
            angle, next_angle = next_angle, angle + 2.0 * part * next_speed
            speed, next_speed = next_speed, speed + 2.0 * part * pull
        table[row, 0], table[row, 1] = next_angle, next_speed
        for back in range(row - 1, -1, -1):
            ratio = (count / _SUBSTEPS[back]) ** 2 - 1.0
            for k in range(2):
                table[back, k] = table[back + 1, k] + (table[back + 1, k] - table[back, k]) / ratio
    state[i, 0], state[i, 1] = table[0, 0], table[0, 1]


@making_kernel
def _integrate(
    times: Floats, state: Floats, own: Pendulums, support: Support, kicks: Floats, longest: float, out: Floats
) -> None:
    across, along = np.empty(_NODES.size), np.empty(_NODES.size)
    table = np.empty((_SUBSTEPS.size, 2))
    out[:, 0] = state[:, 0]
    for sample in range(1, times.size):
        begin, span = times[sample - 1], times[sample] - times[sample - 1]
        parts = math.ceil(span / longest)
        for part in range(parts):
            for node in range(_NODES.size):
                time = begin + span * (part + _NODES[node] / _GRID) / parts
                across[node], along[node] = _support_at(time, support)
            for i in range(state.shape[0]):
                _step(state, i, span / parts, across, along, own, table)
        for i in range(state.shape[0]):
            state[i, 1] += kicks[i, sample] * math.sqrt(span)
            out[i, sample] = state[i, 0]


def integrate(times: Floats, start: Floats, own: Pendulums, support: Support, kicks: Floats) -> tuple[Floats, Floats]:
    """Elongations (pendulums, samples), rad, at times (samples,), s; and the state (pendulums, 2) at the last. `start`
    (pendulums, 2): elongation rad and rate rad/s at the first; `kicks` (pendulums, samples) change the rate at each,
    rad/s over the root of the interval in s, or are zero."""
    out, state = np.empty((start.shape[0], times.size)), start.copy()
    fastest = float(np.max(support.rate, initial=0.0))
    longest = _KINKED if own.quadratic.any() or own.friction.any() else LONGEST
    # one radian of the fastest harmonic a step: its share of the elongation is small, and so is its error
    _integrate(times, state, own, support, kicks, min(longest, 1.0 / max(fastest, 1.0)), out)
    return out, state


def forced(own: Pendulums, support: Support) -> Floats:
    """Elongation and rate at t = 0 of small forced oscillations, (pendulums, 2): rest would add a free one."""
    rate, across = support.rate, support.across
    square = support.gravity[0] / own.length[:, None]
    answer = -across / own.length[:, None] / (square - rate**2 + 2j * own.damping[:, None] * rate)
    return np.stack([answer.real.sum(axis=1), (1j * rate * answer).real.sum(axis=1)], axis=1)
