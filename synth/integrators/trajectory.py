"""What every integrator takes and returns: checked arguments, trajectories whole or in pieces, one definition of the error.

All have one face, `integrate(system, start, times, *, tolerance) -> Trajectory` (and `stream`, for times in chunks):

    system : NamedTuple    registered with a derivative (`synth.systems`), and whatever else the integrator says
    start : (n,)           state at the first of the times
    times : (k,)           increasing, s; they change neither steps nor intervals
    tolerance : float      error wanted, relative to the largest size of each component

`UsageError` names arguments that cannot be meant; `RefusedError` says when and why an integration came to a stop, or that
the integrator is not made for the system.

Long motions come piece by piece, in memory that does not grow with their length. How they are to be marched, and how good
they will be, is found first, by marches that keep few states; so every refusal is made before the first piece is written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.phase import Floats

Onward = Callable[[Floats], Floats]
"""States (k, n) at increasing times (k,), none before the last asked for."""

FEW = 8192
"""Instants at which a long motion is looked at before it is streamed."""

_NEGLIGIBLE = 1e-14  # share of the largest component


@dataclass(frozen=True)
class Trajectory:
    """States at the requested times, with what they cost and how good they are."""

    times: Floats
    """(k,) s, increasing."""
    states: Floats
    """(k, n) states at `times`."""
    estimated_error: float
    """Largest estimated error of any component at any of `times`, relative to the largest size of that component
    anywhere on the way (start, steps and `times`); see `relative_error`."""
    steps: int
    """Accepted steps."""
    evaluations: int
    """Calls of the derivative, those of rejected steps and of the error estimate included."""
    rejected: int
    """Steps that were tried and given up."""


@dataclass(frozen=True)
class Stream:
    """A trajectory that comes in pieces; iterate over it once."""

    pieces: Iterator[Floats]
    """States (k, n) at one chunk of times after the other."""
    estimated_error: float
    """As of a `Trajectory`: of the march made beforehand."""

    def __iter__(self) -> Iterator[Floats]:
        return self.pieces


def streamed(
    solved: tuple[Trajectory, Callable[[], Onward]], chunks: Iterable[Floats], span: tuple[float, float]
) -> Stream:
    """The stream of a motion that was marched beforehand, as `solve` of an integrator returns it.

    Parameters
    ----------
    solved
        The trajectory, and what begins the march anew at its start.
    chunks : iterable of (k,) arrays
        Increasing times, s, over all chunks.
    span : (float, float)
        Time of the start, and a time that no chunk goes beyond.
    """
    made, begin = solved
    return Stream(_pieces(begin(), chunks, *map(float, span)), made.estimated_error)


def _pieces(onward: Onward, chunks: Iterable[Floats], reached: float, end: float) -> Iterator[Floats]:
    for chunk in chunks:
        times = np.array(chunk, dtype=np.float64)
        if times.size and not (reached <= times[0] and times[-1] <= end and np.all(np.diff(times) > 0)):
            raise UsageError(f"times of a chunk must increase within {reached!r} to {end!r} s")
        reached = float(times[-1]) if times.size else reached
        yield onward(times)


def restarting(march: Callable[[Floats, Floats], Floats], start: Floats, begin: float) -> Onward:
    """March from the last state asked for, by what gives states (k, n) at (k,) times from the state at the first."""
    state, reached = start, begin

    def onward(times: Floats) -> Floats:
        nonlocal state, reached
        fresh = times[times > reached]
        states = march(state, np.concatenate([[reached], fresh]))
        state, reached = states[-1], float(fresh[-1]) if fresh.size else reached
        return states[1 if fresh.size == times.size else 0 :]

    return onward


def checked(
    start: ArrayLike, times: ArrayLike, tolerance: float, range_of: tuple[float, float] = (0.0, 1.0)
) -> tuple[Floats, Floats]:
    """Start and times as arrays, or UsageError; `range_of` bounds the tolerance, itself above zero."""
    first, instants = np.array(start, dtype=np.float64), np.array(times, dtype=np.float64)
    if first.ndim != 1 or first.size == 0 or not np.isfinite(first).all():
        raise UsageError("start: give one row of finite numbers, one for each component of the state")
    if instants.ndim != 1 or instants.size == 0 or not np.isfinite(instants).all() or np.any(np.diff(instants) <= 0.0):
        raise UsageError("times: give finite, increasing instants, the first that of the start")
    if not (tolerance > 0.0 and range_of[0] <= tolerance <= range_of[1]):
        raise UsageError(f"tolerance = {tolerance!r}: give a relative error from {range_of[0]} to {range_of[1]}")
    return first, instants


def reason(system: Any, state: Floats, otherwise: str) -> str:
    """Why a march came to a stop at a state, as the system knows it; otherwise as the integrator saw it."""
    difficulty = getattr(system, "difficulty", None)
    return (difficulty(state) if difficulty is not None else None) or otherwise


def relative_error(difference: Floats, largest: Floats) -> float:
    """Largest of |difference| (k, n) over `largest` (n,); a component that never left zero counts as it is."""
    size = np.where(largest > 0.0, largest, 1.0)
    return float(np.max(np.abs(difference) / size, initial=0.0))


def difference(states: Floats, others: Floats, largest: Floats) -> float:
    """As `relative_error` of two runs; a component that is rounding noise beside the largest counts as it is."""
    return relative_error(others - states, np.where(largest > _NEGLIGIBLE * np.max(largest), largest, 0.0))
