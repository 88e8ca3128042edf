"""What every integrator takes and returns: `integrate(system, start, times, *, tolerance) -> Trajectory`, with

    system : NamedTuple    registered with a derivative (`synth.systems`), and whatever else the integrator says
    start : (n,)           state at the first of the times
    times : (k,)           increasing, s; they change neither steps nor intervals
    tolerance : float      error wanted, relative to the largest size of each component

`UsageError` names arguments that cannot be meant; `RefusedError` says when and why an integration came to a stop, or
that the integrator is not made for the system.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.phase import Floats

_NEGLIGIBLE = 1e-14  # share of the largest component


@dataclass(frozen=True)
class Trajectory:
    """States at the requested times, with what they cost and how good they are."""

    times: Floats  # (k,) s, increasing
    states: Floats  # (k, n) states at `times`
    estimated_error: float
    """Largest estimated error of any component at any of `times`, relative to the largest size of that component
    anywhere on the way (start, steps and `times`); see `relative_error`."""
    steps: int  # Accepted steps
    evaluations: int  # Calls of the derivative, those of rejected steps and of the error estimate included
    rejected: int  # Steps that were tried and given up


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


def spread(count: int) -> Floats:
    """Shares of a span, from 0 on, at which runs are compared: spread unevenly, lest they beat with the swing."""
    numbers = np.arange(count)
    shares: Floats = (numbers + numbers * 0.6180339887498949 % 1.0) / count
    return shares


def relative_error(difference: Floats, largest: Floats) -> float:
    """Largest of |difference| (k, n) over `largest` (n,), or of one component; one that never left zero counts as it is."""
    size = np.where(largest > 0.0, largest, 1.0)
    return float(np.max(np.abs(difference) / size, initial=0.0))


def difference(states: Floats, others: Floats, largest: Floats) -> float:
    """As `relative_error` of two runs; a component that is rounding noise beside the largest counts as it is."""
    size = np.where(largest > _NEGLIGIBLE * np.max(largest), largest, 0.0)
    return relative_error(others - states, size)
