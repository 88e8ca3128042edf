"""One march of the explicit integrator at a local tolerance, in one piece or in many; why it ended, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators.events_kick import Escapement, Memory, memory, roomier
from synth.integrators.explicit_march import (
    DONE,
    FULL,
    NOT_FINITE,
    STIFF_STEPS,
    TOO_LONG,
    TOO_STIFF,
    march,
    start_march,
)
from synth.integrators.explicit_progress import TIME, WRITTEN, begin_at
from synth.phase import Floats, Integers


class StiffError(RefusedError):
    """Refused since the motion is stiff."""


class Walk:
    """A march that goes on from call to call.

    Parameters
    ----------
    system : NamedTuple
    event : Crossings, Escapement or None
    start : (n,) array
    begin, end : float
        Times of the start and of the last output that will be asked for, s.
    tolerance : float
        Local error allowed, relative to the largest size of each component so far.
    patience : int
        Steps at the edge of stability after which the motion counts as stiff.
    amiss : float
        See `march`.
    """

    def __init__(
        self,
        system: Any,
        event: Any,
        start: Floats,
        begin: float,
        end: float,
        tolerance: float,
        patience: int = STIFF_STEPS,
        amiss: float = 0.0,
    ) -> None:
        self.system, self.event, self.end, self.tolerance = system, event, end, tolerance
        self.patience, self.amiss = patience, amiss
        self.progress = begin_at(start, begin)
        self.events: Memory | None = memory(event, self.progress.state.size)
        self._judge(start_march(system, event, self.events, self.progress, end, tolerance))

    @property
    def scale(self) -> Floats:
        """(n,) largest size of each component so far."""
        return self.progress.scale.copy()

    def onward(self, times: Floats) -> Floats:
        """States (k, n) at increasing times, none before the last asked for; RefusedError names why there are none."""
        states = np.empty((times.size, self.progress.slope.size))
        written = 0
        while True:
            status = march(
                self.system, self.event, self.events, self.progress, times[written:], self.end, self.tolerance,
                states[written:], self.patience, self.amiss,
            )  # fmt: skip
            if status != FULL or self.events is None:
                break
            written += int(self.progress.counts[WRITTEN])
            self.events = roomier(self.events)
        self._judge(status)
        return states

    def happenings(self) -> tuple[Floats, Integers]:
        """Times of the events since they were last asked for, and the number of the watch that saw each."""
        found = happenings(self.events)
        if self.events is not None:
            self.events.noted[0] = 0
        return found

    def _judge(self, status: int) -> None:
        if status != DONE:
            kind = StiffError if status == TOO_STIFF else RefusedError
            raise kind(_reason(status, self.system, float(self.progress.clock[TIME]), self.progress.state))


@dataclass(frozen=True)
class Run:
    """A march that is done: states, sizes of the components, costs, and its events."""

    times: Floats
    states: Floats
    scale: Floats
    counts: Integers
    """Steps, rejected steps, evaluations."""
    events: Memory | None
    kicked: bool
    tolerance: float

    def happenings(self) -> tuple[Floats, Integers]:
        """Times of the events, and the number of the watch that saw each."""
        return happenings(self.events)


def happenings(notes: Memory | None) -> tuple[Floats, Integers]:
    """Times of the events noted, and the number of the watch that saw each."""
    if notes is None:
        return np.zeros(0), np.zeros(0, dtype=np.int64)
    count = int(notes.noted[0])
    return notes.times[:count] + notes.lows[:count], notes.which[:count].copy()


def run(
    system: Any,
    event: Any,
    start: Floats,
    times: Floats,
    tolerance: float,
    patience: int = STIFF_STEPS,
    amiss: float = 0.0,
) -> Run:
    """One march over `times`, as `Walk`."""
    walk = Walk(system, event, start, float(times[0]), float(times[-1]), tolerance, patience, amiss)
    states = walk.onward(times)
    counts = walk.progress.counts[:3].copy()
    return Run(times, states, walk.scale, counts, walk.events, isinstance(event, Escapement), tolerance)


def _reason(status: int, system: Any, time: float, state: Floats) -> str:
    name, when = type(system).__name__, f"at t = {time:.6g}"
    difficulty = getattr(system, "difficulty", None)
    known = difficulty(state) if difficulty is not None else None
    if known:
        return f"explicit, {name} {when}: {known}"
    if status == TOO_STIFF:
        return (
            f"explicit, {name} {when}: the motion is stiff (use the propagator radau), or it stands at the top of a"
            " swing where rounding decides (move the start)"
        )
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
