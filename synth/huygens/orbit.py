"""Periodic orbits of two clocks on a beam by shooting, and their Floquet multipliers.

With R the mirror of the clocks, `R flow(x, T/2) = x` is solved by Newton's method for x and T/2, with the phase
anchored where the first clock turns back. The multipliers are those of R d flow/dx; of a whole swing, their squares.

The Runge-Kutta formula is of order 8; tangents are central differences of three steps, right to 1e-12.
"""

import cmath
import math
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError, UsageError
from synth.huygens.balance import Regime, solutions
from synth.huygens.clocks import Clocks, eigenvalues_beside, mirrored
from synth.integrators.explicit_step import Space, attempt
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import derivative

STEPS = 48  # Of half a swing: the beam turns by 0.13 rad in each, which order 8 resolves to 1e-13.
_ORDER = 8
_APART, _SHARES = 3e-3, (1.5, -0.6, 0.1)  # of tangents: step of the differences over the state's size, and weights
_MOST_TURNS = 30
_SETTLED = 3e-14  # change of a turn, of the state's size
_NEUTRAL = 1e-9  # |multiplier| - 1 below which nothing is said
_RATE = 3  # place of the first clock's rate in the state


def carried(system: Any, start: Floats, duration: float, steps: int) -> tuple[Floats, Floats]:
    """States (steps + 1, n) at even instants, steps even, and the derivative (n, n) of the last by the first."""

    n = start.size
    space = Space._make([*np.zeros((11, n)), np.zeros((16, n)), np.zeros((7, n))])

    def flow(begin: Floats) -> Floats:
        states = np.empty((steps + 1, n))
        states[0] = begin
        _integrate(system, states, duration / steps, space)
        return states

    apart = _APART * float(np.abs(start).max()) * np.eye(n)
    tangents = np.zeros_like(apart)
    for k, share in enumerate(_SHARES, start=1):
        above, below = (np.array([flow(start + sign * k * unit)[-1] for unit in apart]) for sign in (1.0, -1.0))
        tangents += share * (above - below).T / (2 * k * apart[0, 0])
    return flow(start), tangents


@kernel
def _integrate(system: Any, states: Floats, step: float, space: Space) -> None:
    """Fill `states` (steps + 1, n) from the first on."""
    for index in range(states.shape[0] - 1):
        for i in range(states.shape[1]):
            space.state[i] = states[index, i]
        derivative(index * step, space.state, system, space.slope)
        for i in range(states.shape[1]):
            space.k[0, i] = space.slope[i]
        attempt(index * step, step, space, system)
        for i in range(states.shape[1]):
            states[index + 1, i] = space.state[i] + space.increment[i]


class Orbit(NamedTuple):
    """A synchronous regime as it really is."""

    state: Floats  # (6,) at the moment when the first clock turns back
    half_period: float  # T/2 of the clocks, which is the beam's whole period; time s = w0 t/2
    residual: float  # largest of |R flow(x, T/2) - x|
    error: float  # estimate, from half as many steps, of what the formula errs in state and tangents over half a swing
    regime: Regime  # first harmonics of the clocks and second of the beam, as the balance writes them
    multipliers: tuple[complex, ...]  # five, of half a swing, the largest first; the sixth, along the orbit, is 1

    @property
    def growth(self) -> float:
        """Largest rate of a perturbation per z (z grows by pi in half a swing)."""
        return math.log(max(abs(self.multipliers[0]), 1e-300)) / math.pi

    @property
    def stable(self) -> bool | None:
        """Whether all multipliers lie within the unit circle; None where the largest is on it to what is known."""
        beyond = abs(self.multipliers[0]) - 1.0
        return None if abs(beyond) <= max(_NEUTRAL, self.error) else beyond < 0.0


def orbits(clocks: Clocks, *, full: bool = False, steps: int = STEPS) -> list[Orbit]:
    """Orbits that grow out of the synchronous regimes of the slow flow, in the same order; see `orbit`."""
    pair = clocks if full else clocks._replace(swing=0.0)
    return [orbit(each, pair, full=full, steps=steps) for each in solutions(pair, shifts=True)]


def orbit(regime: Regime, clocks: Clocks, *, full: bool = False, steps: int = STEPS) -> Orbit:
    """Find the orbit near a synchronous regime, of system (2) or the full one (1), in steps of half a swing.

    `RefusedError` if Newton's method does not settle, or only on a motion that is none; `UsageError` if the steps are
    not a multiple of 4.
    """
    if steps < 8 or steps % 4:
        raise UsageError(f"steps = {steps}: give a multiple of 4, 8 or more, such as {STEPS}")
    system: Any = clocks.full() if full else clocks.small()
    arcs = np.repeat([clocks.swing * (1.0 + each) for each in clocks.detuning], 2)
    units = np.array([1.0, 1.0, *arcs]) if full else np.ones(6)  # the state of the system over that of (2)
    guess = start_of(regime) * units
    state, half, residual = _shot(system, guess, math.pi * math.sqrt(1.0 + regime.beta), steps)
    states, tangents = carried(system, state, half, steps)
    coarse, rough = carried(system, state, half, steps // 2)
    apart = float(np.abs((coarse[-1] - states[-1]) / units).max() + np.abs(rough - tangents).max())
    rate = np.empty(state.size)
    derivative(0.0, state, system, rate)  # along the orbit, where the multiplier is 1
    multipliers = sorted(eigenvalues_beside(mirrored(tangents.T).T, rate), key=lambda each: -abs(each))
    regime = _harmonics(states[:-1] / units, half)
    return Orbit(state, half, residual, apart / (2.0**_ORDER - 1.0), regime, tuple(multipliers))


def start_of(regime: Regime) -> Floats:
    """State (u, u', y_1, y_1', y_2, y_2') of a regime, in time s, when the first clock turns back."""
    per_s = 1.0 / math.sqrt(1.0 + regime.beta)
    z = regime.alpha[0]
    beam = [-0.5 * regime.q * math.cos(2.0 * z), regime.q * math.sin(2.0 * z) * per_s]
    for angle, size in zip(regime.alpha, regime.amplitude, strict=True):
        beam += [size * math.cos(z - angle), -size * math.sin(z - angle) * per_s]
    return np.array(beam)


def _shot(system: Any, guess: Floats, half: float, steps: int) -> tuple[Floats, float, float]:
    state, rate, left = guess.copy(), np.empty(guess.size), math.inf
    size = np.maximum(np.abs(guess).max(), 1e-12)
    for _ in range(_MOST_TURNS):
        with np.errstate(all="ignore"):
            states, tangents = carried(system, state, half, steps)
        if not np.isfinite(tangents).all():
            break
        miss = mirrored(states[-1]) - state
        before, left = left, float(np.abs(miss).max())
        derivative(0.0, states[-1], system, rate)
        matrix = np.zeros((7, 7))
        matrix[:6, :6] = mirrored(tangents.T).T - np.eye(6)
        matrix[:6, 6] = mirrored(rate)
        matrix[6, _RATE] = 1.0
        step = np.linalg.lstsq(matrix, -np.append(miss, state[_RATE]), rcond=1e-15)[0]
        reach = np.abs(step[:6]).max() / size
        if reach <= _SETTLED or (left <= 1e-13 * size and left >= 0.5 * before):
            if np.abs(state[2:]).max() < 1e-3 * size:
                break  # everything at rest
            return state, half, left
        shorter = min(1.0, 0.5 / max(reach, 1e-300))
        state, half = state + shorter * step[:6], half + shorter * float(step[6])
    raise RefusedError(
        "no periodic orbit near this regime: shooting does not settle; begin from a regime of these clocks"
    )


def _harmonics(states: Floats, half: float) -> Regime:
    """What the balance would call this orbit; `states` over half a swing, its end left out."""
    turns = np.exp(-1j * math.pi * np.arange(len(states)) / len(states))
    beam = complex(-4.0 * np.mean(states[:, 0] * turns**2))  # Q: u'' = 2 Re(Q e^{2iz})
    origin = 0.5 * cmath.phase(beam)
    swings = [complex(2.0 * np.mean(states[:, place] * turns)) for place in (2, 4)]  # A e^{-i alpha}
    angles = [math.remainder(origin - cmath.phase(each), math.pi) for each in swings]
    beta = (half / math.pi) ** 2 - 1.0
    return Regime(beta, abs(beam), (angles[0], angles[1]), (abs(swings[0]), abs(swings[1])))
