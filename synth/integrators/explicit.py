"""The explicit integrator of order 8: for violent, driven and escaping motion that is not stiff.

Several marches are made. The first has a local tolerance `RATIO` times looser, and its difference from the second
gives the error of the second, since errors are proportional to the tolerance; the first from a start moved by
`PROBE` tells what rounding grows to. If the second turns out worse than asked, a last one is made with the
tolerance that the others call for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.events_kick import Escapement, Memory, memory
from synth.integrators.explicit_march import DONE, MOST_STEPS, NOT_FINITE, STIFF, STIFF_STEPS, TOO_LONG, march
from synth.integrators.trajectory import Trajectory, relative_error
from synth.phase import Floats, Integers

RATIO = 1e4
PROBE = 1e-9
"""Change of the start, relative to the size of each component, that shows what the motion makes of rounding."""
LOOSEST = 1e-6
TIGHTEST = 1e-17
"""Local tolerance, relative; below the rounding of a step because increments are added with compensation."""
_NEGLIGIBLE = 1e-14  # a component smaller than this share of the largest is rounding noise
_ROUNDING = 2.2e-16
_ROUGHEST = 1e-4
_PROBED_BELOW = 1e-8  # looser tolerances are far above anything that rounding does
_FEW = 0.01  # outputs that may fall between the kicks of two runs
_CHECKS = 65
_AIM = 0.5  # of the tolerance, when a third march is made


@dataclass(frozen=True)
class Run:
    """One march: states, sizes of the components, costs, and its events."""

    times: Floats
    states: Floats
    scale: Floats
    counts: Integers
    events: Memory | None
    kicked: bool
    tolerance: float


def integrate(system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10) -> Trajectory:
    """Integrate a system and return its states at `times`.

    Parameters
    ----------
    system : NamedTuple
        Registered with a derivative (`synth.systems`).
    start : (n,) array
        State at the first of `times`.
    times : (k,) array
        Increasing, s. They do not change the steps.
    tolerance : float
        Error wanted at the end, relative to the size of each component.

    Returns
    -------
    Trajectory

    Raises
    ------
    RefusedError
        Stiff motion, a singularity, numbers that are not finite.
    UsageError
        Arguments that cannot be meant.

    Examples
    --------
    >>> from synth.systems.driven_pendulums import plain
    >>> swing = integrate(plain(2.0), [0.1, 0.0], [0.0, 1.0], tolerance=1e-12)
    >>> round(float(swing.states[1, 0]), 6)
    -0.041671
    """
    first, instants = checked(start, times, tolerance)
    return trajectory(refine(system, None, first, with_checks(instants), tolerance), instants)


def with_checks(times: Floats) -> Floats:
    """More instants where few are asked for: an error may pass through zero at a single one."""
    if times.size == 1 or times.size >= _CHECKS:
        return times
    return np.union1d(times, np.linspace(times[0], times[-1], _CHECKS)[:-1])


def trajectory(made: Refinement, times: Floats) -> Trajectory:
    """What is returned of the marches made, at the instants asked for."""
    best = made.runs[-1]
    states = best.states if best.times.size == times.size else best.states[np.searchsorted(best.times, times)]
    return Trajectory(times, states, made.estimated_error, made.cost(0), made.cost(2), made.cost(1))


def checked(start: ArrayLike, times: ArrayLike, tolerance: float) -> tuple[Floats, Floats]:
    """Arguments as arrays, or UsageError."""
    first = np.array(start, dtype=np.float64)
    instants = np.array(times, dtype=np.float64)
    if first.ndim != 1 or first.size == 0 or not np.isfinite(first).all():
        raise UsageError("start must be one row of finite numbers, one for each component of the state")
    if instants.ndim != 1 or instants.size == 0 or not np.isfinite(instants).all() or np.any(np.diff(instants) <= 0.0):
        raise UsageError("times must be finite and increasing, and begin with the time of the start")
    if not 0.0 < tolerance <= 1.0:
        raise UsageError(f"tolerance = {tolerance!r}: give a relative error above 0, such as 1e-10")
    return first, instants


@dataclass(frozen=True)
class Refinement:
    """All that was marched for one trajectory."""

    runs: list[Run]
    """From the loosest to the last, which is the result."""
    probe: Run | None
    """The loosest again, from a start moved by `PROBE`."""
    estimated_error: float

    def rounding(self) -> float:
        """Rounding that a march makes, relative; to be multiplied by what the motion makes of it."""
        return _ROUNDING * (2.0 + 0.2 * float(np.sqrt(self.runs[-1].counts[0])))

    def cost(self, row: int) -> int:
        """Sum of a count over all marches: 0 steps, 1 rejected, 2 evaluations."""
        runs = self.runs if self.probe is None else [*self.runs, self.probe]
        return sum(int(run.counts[row]) for run in runs)


def refine(system: Any, event: Any, start: Floats, times: Floats, tolerance: float) -> Refinement:
    """March until the estimated error meets the tolerance or rounding stops it."""
    local = max(min(tolerance, LOOSEST), TIGHTEST)
    fine = run(system, event, start, times, local, np.abs(start))
    # at the edge of stability a loose march is no wrong one, and no longer than the tight one that was found not stiff
    loose = min(RATIO * local, _ROUGHEST)
    rough = run(system, event, start, times, loose, fine.scale, patience=MOST_STEPS)
    probe = None
    if tolerance < _PROBED_BELOW:
        signs = 1.0 - 2.0 * (np.arange(start.size) // 2 % 2)
        moved = start + PROBE * signs * fine.scale
        probe = run(system, event, moved, times, loose, fine.scale, patience=MOST_STEPS)
    error = estimate(Refinement([rough, fine], probe, np.inf))
    result = Refinement([rough, fine], probe, error)
    if error > tolerance and local > TIGHTEST:
        local = max(TIGHTEST, local * min(0.1, _AIM * tolerance / error))
        finest = run(system, event, start, times, local, fine.scale)
        result = Refinement([rough, fine, finest], probe, np.inf)
        result = Refinement(result.runs, probe, estimate(result))
    return result


def estimate(made: Refinement) -> float:
    """Error of the last run: what its tolerance makes of its difference from the one before, and rounding.

    Errors are proportional to the local tolerance. What the motion makes of rounding is what it makes of a small
    change of the start: much near the top of a swing, where a step itself is innocent.
    """
    rough, fine = made.runs[-2:]
    error = difference(rough, fine) * fine.tolerance / rough.tolerance
    growth = 1.0 if made.probe is None else max(1.0, difference(made.probe, made.runs[0]) / PROBE)
    return error + growth * made.rounding()


def difference(one: Run, other: Run) -> float:
    """Largest relative difference of two runs; 1 where their kicks do not match.

    Kicks are at slightly different times in the two: only outputs between the same kicks are compared.
    """
    largest = np.maximum(other.scale, np.max(np.abs(other.states), axis=0))
    size = np.where(largest > _NEGLIGIBLE * np.max(largest), largest, 0.0)
    comparable = kicks_before(one) == kicks_before(other)
    if np.count_nonzero(comparable) < (1.0 - _FEW) * comparable.size - 1:
        return 1.0
    return relative_error((other.states - one.states)[comparable], size)


def kicks_before(run: Run) -> Integers:
    """How many events each output has behind it."""
    if run.events is None or not run.kicked:
        return np.zeros(run.times.size, dtype=np.int64)
    return np.searchsorted(run.events.times[: int(run.events.noted[0])], run.times).astype(np.int64)


def run(
    system: Any, event: Any, start: Floats, times: Floats, tolerance: float, scale: Floats, patience: int = STIFF_STEPS
) -> Run:
    """One march at a local tolerance; RefusedError names why it ended before."""
    counts = np.zeros(3, dtype=np.int64)
    states = np.empty((times.size, start.size))
    stop = np.empty(1 + start.size)
    capacity = 4096
    while True:
        sizes = scale.copy()
        notes = memory(event, start.size, capacity)
        status = march(system, event, notes, start, times, tolerance, sizes, states, counts, stop, patience)
        if notes is None or notes.noted[0] <= capacity:
            break
        capacity = 8 * int(notes.noted[0])
    if status != DONE:
        raise RefusedError(_reason(status, system, float(stop[0]), stop[1:]))
    return Run(times, states, sizes, counts, notes, isinstance(event, Escapement), tolerance)


def _reason(status: int, system: Any, time: float, state: Floats) -> str:
    name, when = type(system).__name__, f"at t = {time:.6g}"
    difficulty = getattr(system, "difficulty", None)
    known = difficulty(state) if difficulty is not None else None
    if known:
        return f"explicit, {name} {when}: {known}"
    if status == STIFF:
        return f"explicit, {name} {when}: the motion is stiff; use the propagator radau"
    if status == NOT_FINITE:
        return (
            f"explicit, {name} {when}: the acceleration is not finite; look for a singular state or NaN in parameters"
        )
    if status == TOO_LONG:
        return f"explicit, {name} {when}: more steps than can be counted; shorten the record or loosen the tolerance"
    return (
        f"explicit, {name} {when}: the step shrank to the rounding of time, as at a jump or in stiff motion;"
        " use the propagator radau"
    )
