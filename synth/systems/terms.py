"""Terms of an equation of motion, composed by TYPE: what a scene leaves out is `None` and compiles to nothing.

Three questions are put to a term, and each is answered by the kernel that the term's type was registered with:

    motion(time, term)                                   -> acceleration of the support, or None
    driven(acceleration, index, angle, rate, term)       -> acceleration with the term's share added
    driven_slope(slopes, index, angle, rate, term)       -> (d/d angle, d/d rate) with the term's share added

`Both(first, second)` is the sum of two terms; `together(...)` folds any number of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from numba.core import types

from synth.systems.choice import chosen_for, plain

Function = TypeVar("Function", bound=Callable[..., Any])

_TABLE: dict[str, dict[type, Callable[..., Any]]] = {"motion": {}, "driven": {}, "driven_slope": {}}


def term(role: str, kind: type) -> Callable[[Function], Function]:
    """Decorator: the kernel below answers `role` for terms of type `kind`."""

    def note(function: Function) -> Function:
        _TABLE[role][kind] = function
        return function

    return note


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
    present = [each for each in terms if each is not None]
    if not present:
        return None
    folded = present[-1]
    for each in reversed(present[:-1]):
        folded = Both(each, folded)
    return folded


def motion(time: float, term: Any) -> Any:
    """Acceleration of the support in m/s^2, or None where there is none."""
    return None if term is None else _TABLE["motion"][type(term)](time, term)


def driven(acceleration: float, index: int, angle: float, rate: float, term: Any) -> float:
    """Angular acceleration of pendulum `index`, rad/s^2, with the share of `term` added."""
    if term is None:
        return acceleration
    if isinstance(term, Both):
        return driven(driven(acceleration, index, angle, rate, term.first), index, angle, rate, term.second)
    return plain(_TABLE["driven"][type(term)])(acceleration, index, angle, rate, term)


def driven_slope(slopes: tuple[float, float], index: int, angle: float, rate: float, term: Any) -> tuple[float, float]:
    """Partial derivatives of `driven` by angle and rate."""
    if term is None:
        return slopes
    if isinstance(term, Both):
        return driven_slope(driven_slope(slopes, index, angle, rate, term.first), index, angle, rate, term.second)
    by_angle, by_rate = plain(_TABLE["driven_slope"][type(term)])(slopes, index, angle, rate, term)
    return float(by_angle), float(by_rate)


def _kernel(role: str, kind: Any) -> Callable[..., Any]:
    chosen = getattr(kind, "instance_class", None)
    if chosen not in _TABLE[role]:
        raise TypeError(f"{kind} is no term with {role}")
    return _TABLE[role][chosen]


def _is_both(kind: Any) -> bool:
    return getattr(kind, "instance_class", None) is Both


@chosen_for(motion)
def _motion(time: Any, term: Any) -> Any:
    if isinstance(term, types.NoneType):
        return lambda time, term: None
    chosen = _kernel("motion", term)
    return lambda time, term: chosen(time, term)


@chosen_for(driven)
def _driven(acceleration: Any, index: Any, angle: Any, rate: Any, term: Any) -> Any:
    if isinstance(term, types.NoneType):
        return lambda acceleration, index, angle, rate, term: acceleration
    if _is_both(term):
        return lambda acceleration, index, angle, rate, term: driven(
            driven(acceleration, index, angle, rate, term.first), index, angle, rate, term.second
        )
    return plain(_kernel("driven", term))


@chosen_for(driven_slope)
def _driven_slope(slopes: Any, index: Any, angle: Any, rate: Any, term: Any) -> Any:
    if isinstance(term, types.NoneType):
        return lambda slopes, index, angle, rate, term: slopes
    if _is_both(term):
        return lambda slopes, index, angle, rate, term: driven_slope(
            driven_slope(slopes, index, angle, rate, term.first), index, angle, rate, term.second
        )
    return plain(_kernel("driven_slope", term))
