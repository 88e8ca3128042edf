"""Impulses at set times: the march halts a step there, the state jumps, and it goes on.

A system that carries `kicks` (`Impulses`) has them; for all others, and for `kicks = None`, nothing is compiled.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from synth.phase import Floats
from synth.systems.choice import taken_in


class Impulses(NamedTuple):
    """Changes of angles and angular velocities at even times; impulse j, from 0, comes at (j + 1) * step."""

    step: float
    """s."""
    kept: Floats
    """(impulses, pendulums) what stays of angle and rate."""
    angles: Floats
    rates: Floats
    """(impulses, pendulums) what is added to them, rad and rad/s."""


def kicks_of(system: Any) -> Any:
    """The impulses of a system, or None."""
    return getattr(system, "kicks", None)


overload(kicks_of, strict=False)(
    lambda system: (lambda system: system.kicks) if "kicks" in getattr(system, "fields", ()) else (lambda system: None)
)


@taken_in
def halt(kicks: Impulses | None, number: int, end: float) -> float:
    """Time of impulse `number`, or the end of the march if that is earlier."""
    if kicks is None:
        return end
    return min(end, (number + 1) * kicks.step) if number < kicks.rates.shape[0] else end


@taken_in
def jolt(kicks: Impulses | None, number: int, state: Floats) -> None:
    """Add impulse `number` to the state of a system whose first angle leads it."""
    if kicks is not None:
        for i in range(kicks.rates.shape[1]):
            state[2 * i] = kicks.kept[number, i] * state[2 * i] + kicks.angles[number, i]
            state[2 * i + 1] = kicks.kept[number, i] * state[2 * i + 1] + kicks.rates[number, i]
