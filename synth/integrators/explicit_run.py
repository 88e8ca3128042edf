"""One march of the explicit integrator at a local tolerance, in one piece or in many; why it ended, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators import explicit_march as marching
from synth.integrators.events import Escapement, Memory, happenings, memory, roomier
from synth.integrators.trajectory import reason
from synth.phase import Floats, Integers

_REASONS = {
    marching.TOO_STIFF: "the motion is stiff (use the propagator radau), or it stands at the top of a swing where rounding"
    " decides (move the start)",
    marching.NOT_FINITE: "the acceleration is not finite; look for a singular state or NaN in parameters",
    marching.TOO_LONG: "more steps than can be counted; shorten the record or loosen the tolerance",
    marching.UNDERFLOW: "the step shrank to the rounding of time, as at a jump or in stiff motion; use the propagator radau",
}


class StiffError(RefusedError):
    """Refused since the motion is stiff."""


@dataclass
class Walk:
    """A march that goes on from call to call."""

    system: Any
    event: Escapement | None
    start: Floats
    """(n,)."""
    begin: float
    end: float
    """Times of the start and of the last output that will be asked for, s."""
    tolerance: float
    """Local error allowed, relative to the largest size of each component so far."""
    patience: int = marching.STIFF_STEPS
    """Steps at the edge of stability after which the motion counts as stiff."""
    amiss: float = 0.0
    """See `march`."""

    def __post_init__(self) -> None:
        self._progress = marching.begin_at(self.start, self.begin)
        self.events: Memory | None = memory(self.event, self.start.size)
        self._judge(
            marching.start_march(self.system, self.event, self.events, self._progress, self.end, self.tolerance)
        )

    @property
    def scale(self) -> Floats:
        """(n,) largest size of each component so far."""
        return self._progress.scale

    @property
    def counts(self) -> Integers:
        """Steps, rejected steps, evaluations so far."""
        return self._progress.counts[:3]

    def onward(self, times: Floats) -> Floats:
        """States (k, n) at increasing times, none before the last asked for; RefusedError names why there are none."""
        states = np.empty((times.size, self._progress.slope.size))
        written = 0
        if self.events is not None:
            self.events.noted[0] = 0  # kicks of the call before: memory does not grow with the motion
        while True:
            status = marching.march(
                self.system, self.event, self.events, self._progress, times[written:], self.end, self.tolerance,
                states[written:], self.patience, self.amiss,
            )  # fmt: skip
            if status != marching.FULL or self.events is None:
                break
            written += int(self._progress.counts[marching.WRITTEN])
            self.events = roomier(self.events)
        self._judge(status)
        return states

    def happenings(self) -> tuple[Floats, Integers]:
        """Times of the kicks of the last call, and the number of each."""
        return happenings(self.events)

    def _judge(self, status: int) -> None:
        if status != marching.DONE:
            kind = StiffError if status == marching.TOO_STIFF else RefusedError
            why = reason(self.system, self._progress.state, _REASONS[status])
            time = self._progress.clock[marching.TIME]
            raise kind(f"explicit, {type(self.system).__name__} at t = {time:.6g}: {why}")


class Run(Walk):
    """A march over `times` that is done; arguments as of `Walk`."""

    def __init__(self, system: Any, event: Escapement | None, start: Floats, times: Floats, *how: Any) -> None:
        super().__init__(system, event, start, float(times[0]), float(times[-1]), *how)
        self.times, self.states = times, self.onward(times)
