"""Near-integrable splitting for driven nonlinear pendulums: the independent check of the other propagators.

The linear pendulum on its moving support, damping included, is solved exactly; what the sine and the vertical
acceleration add is small and given as kicks, with fixed steps, by the schemes of `splitting_schemes`.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError
from synth.integrators.explicit import checked
from synth.integrators.splitting_forcing import Forcing, Swing
from synth.integrators.splitting_march import kicks
from synth.integrators.splitting_schemes import ABA1064, Scheme
from synth.integrators.trajectory import Trajectory, relative_error
from synth.kernels.compiled import kernel
from synth.phase import Floats, damped_frequency, turns
from synth.systems.dispatch import derivative
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.resistance import Viscous
from synth.systems.restoring import Sine

_BLOCK = 8192
_FIRST_STEP = 0.8  # rad of the fastest pendulum
_HALVINGS = 8
_ROUNDING = 2.2e-16
_ASIDE = 2.0**-50  # of the start
_LUCK = 4.0  # rounding is drawn once
_LINEAR = 0.03  # differences of runs above this have nothing to do with the order


def integrate(
    system: DrivenPendulums, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10, scheme: Scheme = ABA1064
) -> Trajectory:
    """Integrate pendulums on a moving support, at evenly spaced times.

    The step is halved until the difference of two runs, over what halving gains at least, meets the tolerance or stops
    falling. What the motion makes of rounding, much near the top of a swing, is seen from a start slightly aside.

    Raises
    ------
    RefusedError
        Terms that the splitting does not know (only viscous damping), overdamped pendulums, uneven times.
    """
    first, instants = checked(start, times, tolerance)
    _accept(system)
    if instants.size == 1:
        return Trajectory(instants, first[None, :].copy(), 0.0, 0, 0, 0)
    interval = _interval(instants)
    fastest = float(np.max(system.natural_frequency))
    steps = max(1, int(np.ceil(float(interval) * fastest / _FIRST_STEP)))
    coarse = march(system, first, instants, interval, steps, scheme)
    total = steps
    error = np.inf
    gain = 2.0 ** min(scheme.orders)
    for _ in range(_HALVINGS):
        steps *= 2
        total += steps
        fine = march(system, first, instants, interval, steps, scheme)
        size = np.max(np.abs(fine), axis=0)
        rounding = _ROUNDING * (2.0 + 0.1 * np.sqrt(steps * instants.size))
        apart = relative_error(fine - coarse, size)
        found = apart / gain + rounding
        stalled = found > 0.5 * error
        # what does not fall is rounding, or the top of a swing that decides: halving gains nothing
        coarse, error = fine, apart + rounding if stalled or apart > _LINEAR else found
        if error <= tolerance or stalled:
            break
    aside = march(system, first * (1.0 + _ASIDE), instants, interval, steps, scheme)
    total += steps
    moved = relative_error(aside - coarse, np.max(np.abs(coarse), axis=0))
    error += moved if moved > _LINEAR else _LUCK * moved * _ROUNDING / _ASIDE
    count = total * (instants.size - 1)
    return Trajectory(instants, coarse, error, count, count * scheme.weights.size, 0)


def march(
    system: DrivenPendulums, start: Floats, times: Floats, interval: Fraction, steps: int, scheme: Scheme
) -> Floats:
    """States (outputs, n) with `steps` steps to an interval; no error estimate."""
    step = interval / steps
    outputs, begin = times.size, float(times[0])
    states = np.empty((outputs, start.size))
    states[0] = start
    across = Forcing(system.horizontal, begin, step)
    along = Forcing(system.vertical, begin, step)
    here = np.zeros(1)
    outputs_a_block = max(1, _BLOCK // steps)
    weights = scheme.weights * float(step)
    for i in range(system.natural_frequency.size):
        n = float(system.natural_frequency[i])
        damping = float(system.terms.damping_rate[i]) if system.terms is not None else 0.0
        exact = damped_frequency(n, damping)
        swing = Swing(n, damping, exact, turns([exact], step))
        damped = swing.damped
        lam = complex(-damping, damped)
        psi, speed = across.response(np.zeros(1, dtype=np.int64), here, swing, system.gravity)
        free, rate = float(start[2 * i] - psi[0, 0]), float(start[2 * i + 1] - speed[0, 0])
        amplitude = np.array([free, -(rate + damping * free) / damped, 0.0, 0.0])
        done = 0
        while done < outputs - 1:
            # c stays in one frame from beginning to end: one begun anew in each block would round each alike
            count = min(outputs_a_block, outputs - 1 - done)
            base = done * steps
            local = np.arange(count * steps)
            ends = (local[:count] + 1) * steps
            moments = (local[:, None] + scheme.nodes[None, :]) * float(step)
            turning = swing.phasors(base + local, scheme.nodes, float(step))
            fading = np.exp(-damping * moments)
            inverse = np.asarray(np.conj(turning) / fading, np.complex128)
            forced, _ = across.response(base + local, scheme.nodes, swing, system.gravity)
            carried = np.empty(count, dtype=np.complex128)
            kicks(
                n, damped, weights, turning * fading, inverse, forced,
                across.level(base + local, scheme.nodes) / system.gravity,
                along.level(base + local, scheme.nodes) / system.gravity,
                steps, amplitude, carried,
            )  # fmt: skip
            frame = swing.phasors(base + ends, here, float(step))[:, 0] * np.exp(-damping * ends * float(step))
            psi, speed = across.response(base + ends, here, swing, system.gravity)
            states[done + 1 : done + 1 + count, 2 * i] = (carried * frame).real + psi[:, 0]
            states[done + 1 : done + 1 + count, 2 * i + 1] = (lam * carried * frame).real + speed[:, 0]
            amplitude *= np.exp(-damping * count * steps * float(step))
            done += count
    grid = [Fraction(begin) + k * interval for k in range(outputs)]
    offsets = np.array([float(Fraction(float(time)) - exact) for time, exact in zip(times, grid, strict=True)])
    _onto(times, offsets, system, states)
    return states


def _accept(system: DrivenPendulums) -> None:
    """RefusedError for what the splitting does not know."""
    if not isinstance(system, DrivenPendulums) or not isinstance(system.restoring, Sine):
        raise RefusedError("splitting: made for pendulums with the full sine on a moving support; use explicit")
    if system.terms is not None:
        if not isinstance(system.terms, Viscous):
            raise RefusedError("splitting: viscous damping only; use explicit for other resistances and drives")
        if np.any(system.terms.damping_rate >= system.natural_frequency):
            raise RefusedError("splitting: a pendulum is overdamped (damping_rate >= frequency); use explicit or radau")


def _interval(times: Floats) -> Fraction:
    """Spacing of even times, exact; RefusedError for others."""
    interval = (Fraction(float(times[-1])) - Fraction(float(times[0]))) / (times.size - 1)
    if np.max(np.abs(times - (times[0] + np.arange(times.size) * float(interval)))) > 1e-6 * float(interval):
        raise RefusedError("splitting: times must be evenly spaced; use explicit")
    return interval


@kernel
def _onto(times: Floats, offsets: Floats, system: DrivenPendulums, states: Floats) -> None:
    """Move states along the motion by the tiny `offsets` between the even grid and the times asked for."""
    slope = np.empty(states.shape[1])
    for k in range(times.size):
        derivative(times[k], states[k], system, slope)
        for i in range(slope.size):
            states[k, i] += offsets[k] * slope[i]
