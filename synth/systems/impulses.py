"""Impulses at set times: the march halts a step there, the angular velocities jump, and it goes on.

A system that carries `kicks` (`Impulses`) has them; for all others, and for `kicks = None`, nothing is compiled.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.core import types

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.choice import chosen_for


class Impulses(NamedTuple):
    """Changes of the angular velocities at even times; impulse j, from 0, comes at (j + 1) * step."""

    step: float
    """s."""
    rates: Floats
    """(impulses, pendulums) rad/s."""


@kernel
def _halt(kicks: Impulses, number: int, end: float) -> float:
    return min(end, (number + 1) * kicks.step) if number < kicks.rates.shape[0] else end


@kernel
def _jolt(kicks: Impulses, number: int, state: Floats) -> None:
    for i in range(kicks.rates.shape[1]):
        state[2 * i + 1] += kicks.rates[number, i]


def halt(system: Any, number: int, end: float) -> float:
    """Time of impulse `number`, or the end of the march if that is earlier."""
    kicks = getattr(system, "kicks", None)
    return end if kicks is None else _halt(kicks, number, end)


def jolt(system: Any, number: int, state: Floats) -> None:
    """Add impulse `number` to the state of a system whose first angle leads it."""
    kicks = getattr(system, "kicks", None)
    if kicks is not None:
        _jolt(kicks, number, state)


def _has_kicks(system: Any) -> bool:
    fields = getattr(system, "fields", ())
    return "kicks" in fields and not isinstance(system.types[fields.index("kicks")], types.NoneType)


@chosen_for(halt)
def _halt_typed(system: Any, number: Any, end: Any) -> Any:
    if _has_kicks(system):
        return lambda system, number, end: _halt(system.kicks, number, end)
    return lambda system, number, end: end


@chosen_for(jolt)
def _jolt_typed(system: Any, number: Any, state: Any) -> Any:
    if _has_kicks(system):
        return lambda system, number, state: _jolt(system.kicks, number, state)
    return lambda system, number, state: None
