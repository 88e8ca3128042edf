"""Radau IIA of variable order (5, 9, 13) for stiff systems of a few unknowns, with an honest error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.radau_march import (
    DONE,
    ENDLESS,
    EVALUATIONS,
    LOOSE,
    REJECTED,
    STAGES,
    STEPS,
    STUCK,
    TIME,
    UNDEFINED,
    march,
    room,
    state_in,
)
from synth.integrators.trajectory import Trajectory, relative_error
from synth.phase import Floats

_TIGHTEST, _LOOSEST = 1e-15, 1e-2
_USUAL = 1e-6  # looser saves next to nothing and errs erratically
_COMPANION, _COARSEST = 10.0, 1e-5  # tolerance of the second integration over that of the first, and at most
_MARGIN = 2.0  # two errors may partly cancel in their difference
_ROUNDED = 2.0**-52

_REASONS = {
    STUCK: "the step fell below 1e-14 of the span: Newton's iteration or the error test fails however short it is "
    "(a jump, or a solution that grows without bound)",
    UNDEFINED: "the derivative is not finite there",
    ENDLESS: "more than 1e8 steps: ask for a shorter span or a looser tolerance",
}


def integrate(
    system: Any,
    start: ArrayLike,
    times: ArrayLike,
    *,
    tolerance: float = 1e-10,
    stages: tuple[int, int] | None = None,
) -> Trajectory:
    """States of a stiff system at `times`.

    The integration is done twice, the second time at a tolerance ten times looser; twice the difference is the
    estimate. It measures the looser one, and so errs on the side of caution. Tolerances above 1e-6 are integrated as
    1e-6: looser ones save next to nothing.

    Parameters
    ----------
    system : NamedTuple
        Of a type registered with a derivative and a Jacobian; see `synth.systems.dispatch`.
    start : (n,) array
        State at the first of `times`; n up to about 12.
    times : (k,) increasing array
        Instants to read at, s. They do not shorten steps.
    tolerance : float
        Error wanted, relative to the largest size of each component, from 1e-15 to 1e-2.
    stages : tuple, optional
        Fewest and most stages (3, 5 or 7); by default chosen from 3 up to what the tolerance is worth.

    Returns
    -------
    Trajectory

    Raises
    ------
    UsageError
        Arguments that cannot be meant.
    RefusedError
        The integration came to a stop; the message says when and why.

    Notes
    -----
    Hairer and Wanner (1999), J. Comput. Appl. Math. 111, 93-111. Jumps of the derivative are integrated over at the
    cost of short steps, not located.

    Examples
    --------
    >>> from synth.systems.van_der_pol import VanDerPol
    >>> fast = integrate(VanDerPol(1000.0), [2.0, 0.0], [0.0, 1.0], tolerance=1e-9)
    >>> round(float(fast.states[1, 0]), 9)
    1.999333371
    """
    (whole,) = stream(system, start, [times], tolerance=tolerance, stages=stages)
    return whole


def stream(
    system: Any,
    start: ArrayLike,
    portions: Iterable[ArrayLike],
    *,
    tolerance: float = 1e-10,
    stages: tuple[int, int] | None = None,
) -> Iterator[Trajectory]:
    """As `integrate`, portion by portion of `times`: a long record need not be held at once.

    The first instant of the first portion is that of the start. Estimate and costs are those so far, the last portion's
    hold for all. A step ends with each portion; otherwise they leave no trace.

    Examples
    --------
    >>> from synth.systems.van_der_pol import VanDerPol
    >>> parts = stream(VanDerPol(10.0), [2.0, 0.0], [[0.0, 1.0], [2.0, 3.0]], tolerance=1e-9)
    >>> [part.states[-1, 0].round(6).item() for part in parts]
    [1.933853, 1.78278]
    """
    state = np.array(start, dtype=np.float64)
    _check(state, tolerance)
    sharper = min(_USUAL, tolerance)
    orders = stages or (3, 5 if sharper > LOOSE else 7)
    best = companion = None
    worst = np.zeros(state.size)
    for times in portions:
        instants = np.array(times, dtype=np.float64)
        _check_times(instants, -math.inf if best is None else best.time)
        if best is None or companion is None:
            best = _March(system, state, instants, sharper, orders)
            companion = _March(system, state, instants, min(_COARSEST, _COMPANION * sharper), orders)
        states = best.advance(instants)
        difference = np.abs(states - companion.advance(instants))
        worst = np.maximum(worst, difference.max(axis=0))
        yield Trajectory(
            times=instants,
            states=states,
            estimated_error=max(_MARGIN * relative_error(worst, best.largest), _ROUNDED),
            steps=int(best.counts[STEPS]),
            evaluations=int(best.counts[EVALUATIONS] + companion.counts[EVALUATIONS]),
            rejected=int(best.counts[REJECTED]),
        )


def _check(start: Floats, tolerance: float) -> None:
    if start.ndim != 1 or start.size == 0 or not math.isfinite(start @ start):
        raise UsageError("start: give one finite number for each component of the state")
    if not _TIGHTEST <= tolerance <= _LOOSEST:
        raise UsageError(f"tolerance: {tolerance} is outside {_TIGHTEST} to {_LOOSEST}")


def _check_times(times: Floats, after: float) -> None:
    if times.ndim != 1 or times.size == 0:
        raise UsageError("times: give one row of instants, the first that of the start")
    if not math.isfinite(times[-1] - times[0]) or not (times[1:] > times[:-1]).all() or not times[0] > after:
        raise UsageError("times: give finite, increasing instants, the first that of the start")


class _March:
    """One integration on its way."""

    def __init__(self, system: Any, start: Floats, times: Floats, tolerance: float, orders: tuple[int, int]) -> None:
        n = start.size
        self._system, self._tolerance, self._orders, self._size = system, tolerance, orders, (0,) * n
        self._space, self._places = np.zeros(room(n)), np.zeros(14 * n, dtype=np.int64)
        self._progress = np.zeros(8)
        self._progress[TIME], self._progress[STAGES] = times[0], orders[1]
        self._state[:] = start
        self.largest = swing_of_bobs(system, start)
        self.counts = np.zeros(3, dtype=np.int64)

    @property
    def time(self) -> float:
        """Reached, s."""
        return float(self._progress[TIME])

    @property
    def _state(self) -> Floats:
        return state_in(self._space, len(self._size))

    def advance(self, times: Floats) -> Floats:
        """States (k, n) at the next `times`."""
        out = np.empty((times.size, len(self._size)))
        outcome = march(
            times, self._tolerance, self._orders, self._size, self._system,
            self._space, self._places, self._progress, out, self.largest, self.counts,
        )  # fmt: skip
        if outcome != DONE:
            difficulty = getattr(self._system, "difficulty", None)
            reason = (difficulty(self._state) if difficulty else None) or _REASONS[outcome]
            raise RefusedError(f"radau: stopped at t = {self.time:.6g} s after {self.counts[STEPS]} steps: {reason}")
        return out


def swing_of_bobs(system: Any, start: Floats) -> Floats:
    """What counts as small, (n,): of a yielding support, displacement and speed of the bobs; of all else nothing.

    Angles cannot feel a displacement of their support that is small against l theta. Were it followed relative to its
    own size, the ringing of a stiff support by a millionth of l would take a thousand times the steps of the swing.
    """
    least = np.zeros(start.size)
    first, length = getattr(system, "first_angle", 0), getattr(system, "length", None)
    if first == 2 and length is not None:
        own = np.sqrt(system.gravity / length)
        swing = length * np.hypot(start[first::2], start[first + 1 :: 2] / own)
        least[0], least[1] = swing.max(), (swing * own).max()
    return least
