"""Terms of an equation of motion, composed by TYPE: what a scene leaves out is `None` and compiles to nothing.

Two questions are put to a term, and each is answered by the kernel that the term's type was registered with:

    motion(time, term)                                   -> acceleration of the support, or None
    driven(acceleration, index, angle, rate, term)       -> acceleration with the term's share added

`Both(first, second)` is the sum of two terms; `together(...)` folds any number of them.

In the frame of a ship every mass feels `-m x''` sideways and `-m z''` upwards (z'' up positive). A bob's share along its
swing is `(g + z'') sin phi + x'' cos phi` (`weight`); the rest acts on what holds the pendulums (`carried`).

A system that has `kicks` (`Impulses`) halts a step at each; for all others, and for `kicks = None`, nothing is compiled.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from synth.phase import Floats
from synth.systems.dispatch import by_type, registered, taken_in


class Both(NamedTuple):
    """The sum of two terms, either of which may be a sum again."""

    first: Any
    second: Any


def together(*terms: Any) -> Any:
    """Fold terms into nested pairs; no term at all is `None`.

    Examples
    --------
    >>> together() is None
    True
    >>> together(1.0, None, 2.0)
    Both(first=1.0, second=2.0)
    """
    folded = None
    for each in reversed(terms):
        folded = each if folded is None else folded if each is None else Both(each, folded)
    return folded


def apart(term: Any) -> list[Any]:
    """The single terms that were folded."""
    if isinstance(term, Both):
        return apart(term.first) + apart(term.second)
    return [] if term is None else [term]


@by_type("term")
def motion(time: float, term: Any) -> Any:
    """Acceleration of the support in m/s^2, or None where there is none."""


@by_type("term")
def driven(acceleration: float, index: int, angle: float, rate: float, term: Any) -> Any:
    """Angular acceleration of pendulum `index`, rad/s^2, with the share of `term` added."""


@registered("motion", type(None))
def _still(time: float, term: None) -> None:
    return None


@registered("driven", type(None))
def _undriven(acceleration: float, index: int, angle: float, rate: float, term: None) -> float:
    return acceleration


@registered("driven", Both)
def _both(acceleration: float, index: int, angle: float, rate: float, term: Both) -> Any:
    return driven(driven(acceleration, index, angle, rate, term.first), index, angle, rate, term.second)


@taken_in
def weight(sine: float, cosine: float, gravity: float, horizontal: float | None, vertical: float | None) -> float:
    """Pull along the swing per mass, `(g + z'') sine + x'' cosine`, m/s^2."""
    pull = (gravity if vertical is None else gravity + vertical) * sine
    return pull if horizontal is None else pull + horizontal * cosine


@taken_in
def carried(force: float, mass: float, acceleration: float | None) -> float:
    """Force with `mass x acceleration` added."""
    return force if acceleration is None else force + mass * acceleration


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
