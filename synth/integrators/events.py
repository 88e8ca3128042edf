"""Instants at which a motion crosses a value, and pendulums kept going by an escapement that kicks them there.

With and without events, long motions come piece by piece (`stream`), in memory that does not grow with their length. The
tolerance of the march is found first, by marches that keep few states (`explicit_error`); what is then streamed is the
last of them once more. So the error is known, and every refusal made, before the first piece is written.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.events_kick import Crossings, Escapement
from synth.integrators.explicit import checked, trajectory
from synth.integrators.explicit_error import ROUNDING, Refinement, gain, refine
from synth.integrators.explicit_run import Walk
from synth.integrators.trajectory import Piece, Stream, Trajectory
from synth.phase import Floats, Integers

_CLEAR = 10.0  # errors by which a turn must miss or pass a level


@dataclass(frozen=True)
class Events:
    """What happened, in order of time."""

    times: Floats
    """(events,) s."""
    watches: Integers
    """(events,) number of the crossing watched for, from 0."""
    estimated_error: float
    """Largest estimated error of `times`, s."""


def crossings(component: ArrayLike, level: ArrayLike, direction: ArrayLike = 1) -> Crossings:
    """Watch components of the state cross levels: direction +1 rising, -1 falling, 0 either."""
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(column)) for column in (component, level, direction)))
    if not np.isin(columns[2], (-1, 0, 1)).all():
        raise UsageError("direction of a crossing: 1 rising, -1 falling, 0 either")
    return Crossings(_whole(columns[0]), _real(columns[1]), _whole(columns[2]))


def escapement(
    system: Any, pendulum: ArrayLike, angle: ArrayLike, energy: ArrayLike, direction: ArrayLike = 1
) -> Escapement:
    """Kick pendulums when they pass an angle.

    Parameters
    ----------
    system : NamedTuple
    pendulum : array of int
        Number of the pendulum each kick belongs to, from 0; a pendulum may have several.
    angle : array
        Crossing angle, rad.
    energy : array
        What a kick adds to the energy of the whole system: J, or per m l^2 (rad^2/s^2) where the system has no
        masses. Not negative.
    direction : array of int
        +1 rising, -1 falling, 0 both ways.
    """
    given = (pendulum, angle, direction, energy)
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(column)) for column in given))
    if not np.isin(columns[2], (-1, 0, 1)).all():
        raise UsageError("direction of a kick: 1 rising, -1 falling, 0 both ways")
    if not (columns[3] >= 0.0).all():
        raise UsageError("energy of a kick must be 0 or more")
    number = _whole(columns[0])
    return Escapement(system.first_angle + 2 * number, _real(columns[1]), _whole(columns[2]), number, _real(columns[3]))


def integrate_with_events(
    system: Any, start: ArrayLike, times: ArrayLike, event: Crossings | Escapement, *, tolerance: float = 1e-10
) -> tuple[Trajectory, Events]:
    """As `explicit.integrate`, noting crossings or giving kicks; the motion restarts after each.

    Crossings are found on the dense polynomial by a method that cannot miss one (`events_roots`), the step is then
    made anew up to the crossing, and the rest removed along the tangent: instants are as good as the states.

    Raises
    ------
    RefusedError
        As `integrate`; and where a crossing is so near to a touch that the tolerance does not decide whether the
        escapement fires.
    """
    first, instants = checked(start, times, tolerance)
    made = refine(system, event, first, instants, tolerance)
    error = decided(made, event)
    happened, which = made.runs[-1].happenings()
    return trajectory(made, instants), Events(happened, which, error)


def stream(
    system: Any,
    start: ArrayLike,
    chunks: Iterable[Floats],
    span: tuple[float, float],
    *,
    tolerance: float = 1e-10,
    event: Crossings | Escapement | None = None,
) -> Stream:
    """As `explicit.integrate` and `integrate_with_events`, for times that come in chunks.

    Parameters
    ----------
    system, start, tolerance, event
        As there.
    chunks : iterable of (k,) arrays
        Increasing times, s, over all chunks. How they are cut changes no bit of the states.
    span : (float, float)
        Time of the start, and a time that no chunk goes beyond.

    Returns
    -------
    Stream

    Examples
    --------
    >>> from synth.systems.driven_pendulums import plain
    >>> pieces = stream(plain(2.0), [0.1, 0.0], [np.array([0.0, 0.5]), np.array([1.0])], (0.0, 1.0))
    >>> [round(float(piece.states[-1, 0]), 6) for piece in pieces]
    [0.054091, -0.041508]
    """
    first, ends = checked(start, np.array(span), tolerance)
    made = refine(system, event, first, ends, tolerance)
    if event is not None:
        decided(made, event)
    pieces = _pieces(system, event, first, chunks, ends, made)
    return Stream(pieces, made.estimated_error, made.cost(0), made.cost(2), made.cost(1))


def _pieces(
    system: Any, event: Any, start: Floats, chunks: Iterable[Floats], span: Floats, made: Refinement
) -> Iterator[Piece]:
    best, reached = made.runs[-1], float(span[0])
    walk = Walk(system, event, start, reached, float(span[1]), best.tolerance)
    for times in chunks:
        instants = np.array(times, dtype=np.float64)
        if instants.size and not (reached <= instants[0] and instants[-1] <= span[1] and np.all(np.diff(instants) > 0)):
            raise UsageError(f"times of a chunk must increase within {reached!r} to {float(span[1])!r} s")
        reached = float(instants[-1]) if instants.size else reached
        yield Piece(walk.onward(instants), *walk.happenings())


def decided(made: Refinement, event: Crossings | Escapement) -> float:
    """Estimated error of the instants of events, s; RefusedError where the marches do not decide what happened."""
    rough, fine = made.runs[-2:]
    begin, end = float(fine.times[0]), float(fine.times[-1])
    shift = _shift(rough.happenings(), fine.happenings(), end)
    assert fine.events is not None  # since there is an event
    grazing = np.any(fine.events.margins < _CLEAR * made.estimated_error * fine.scale[event.component])
    if shift is None or grazing:
        raise RefusedError(
            "events: whether a crossing happens is not decided by the tolerance (the motion only touches the level);"
            " move the level, or ask for a smaller tolerance"
        )
    error = shift * gain(rough, fine)
    if made.probe is not None:
        moved = _shift(made.probe.noisy.happenings(), made.probe.quiet.happenings(), end)
        error += (end - begin if moved is None else moved) * ROUNDING / made.probe.noise
    which = fine.happenings()[1]
    rates, sizes = np.abs(fine.events.rates[: which.size]), fine.scale[event.component[which]]
    late = np.divide(made.estimated_error * sizes, rates, out=np.zeros_like(rates), where=rates > 0.0)
    return max(error, float(np.max(late, initial=0.0))) + 4.4e-16 * max(abs(begin), abs(end))


def _shift(rough: tuple[Floats, Integers], fine: tuple[Floats, Integers], end: float) -> float | None:
    """Largest difference of the instants of two runs, watch by watch; None where they differ in number."""
    largest = 0.0
    for watch in np.unique(np.concatenate([rough[1], fine[1]])):
        one, other = rough[0][rough[1] == watch], fine[0][fine[1] == watch]
        common = min(one.size, other.size)
        largest = max(largest, float(np.max(np.abs(one[:common] - other[:common]), initial=0.0)))
        beyond = np.concatenate([one[common:], other[common:]])
        if beyond.size > 1 or np.any(end - beyond > 10.0 * largest + 1e-9 * abs(end)):
            return None
    return largest


def _whole(column: Any) -> Integers:
    return np.ascontiguousarray(column, dtype=np.int64)


def _real(column: Any) -> Floats:
    return np.ascontiguousarray(column, dtype=np.float64)
