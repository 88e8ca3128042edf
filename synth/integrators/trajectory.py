"""What every integrator returns, and the one definition of its error estimate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from synth.phase import Floats, Integers


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


class Piece(NamedTuple):
    """States at one chunk of times, and the events up to its end, where any are watched for."""

    states: Floats
    """(k, n)."""
    events: Floats = np.empty(0)
    """(events,) times, s."""
    watches: Integers = np.empty(0, dtype=np.int64)
    """(events,) number of the crossing watched for, from 0."""


@dataclass(frozen=True)
class Stream:
    """A trajectory that comes in pieces; iterate over it once."""

    pieces: Iterator[Piece]
    estimated_error: float
    """As of a `Trajectory`."""
    steps: int
    evaluations: int
    rejected: int
    """Of all marches made beforehand."""

    def __iter__(self) -> Iterator[Piece]:
        return self.pieces


_FEW = 8192
"""Instants at which a long motion is looked at before it is streamed."""


def rehearsal(start: ArrayLike, span: tuple[float, float]) -> tuple[Floats, Floats]:
    """Start and instants of the marches that tell how a long motion is to be marched, and how good it will be."""
    return np.array(start, dtype=np.float64), np.linspace(*span, _FEW)


def onward(
    march: Callable[[Floats, Floats], Floats], start: Floats, begin: float, chunks: Iterable[Floats]
) -> Iterator[Piece]:
    """States at chunk after chunk, each marched from the last state of the one before.

    Parameters
    ----------
    march
        States (k, n) at times (k,), given the state at the first of them.
    start : (n,) array
    begin : float
        Time of the start.
    chunks : iterable of (k,) arrays
        Increasing times; the first may be that of the start.
    """
    state, reached = start, begin
    for times in chunks:
        fresh = times[times > reached]
        states = march(state, np.concatenate([[reached], fresh]))
        yield Piece(states[1 if fresh.size == times.size else 0 :])
        state, reached = states[-1], float(times[-1])


def relative_error(difference: Floats, largest: Floats) -> float:
    """Largest of |difference| (k, n) over `largest` (n,); a component that never left zero counts as it is.

    Examples
    --------
    >>> relative_error(np.array([[1e-9, -2e-9]]), np.array([1.0, 0.5]))
    4e-09
    """
    size = np.where(largest > 0.0, largest, 1.0)
    return float(np.max(np.abs(difference) / size, initial=0.0))
