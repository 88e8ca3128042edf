"""Terms of an equation of motion, composed by TYPE: what a scene leaves out is `None` and compiles to nothing.

Three questions are put to a term, and each is answered by the kernel that the term's type was registered with:

    motion(time, term)                                   -> acceleration of the support, or None
    driven(acceleration, index, angle, rate, term)       -> acceleration with the term's share added
    driven_slope(slopes, index, angle, rate, term)       -> (d/d angle, d/d rate) with the term's share added

`Both(first, second)` is the sum of two terms; `together(...)` folds any number of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from synth.systems.dispatch import by_type, registered

Slopes = tuple[float, float]


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


@by_type("term")
def motion(time: float, term: Any) -> Any:
    """Acceleration of the support in m/s^2, or None where there is none."""


@by_type("term")
def driven(acceleration: float, index: int, angle: float, rate: float, term: Any) -> Any:
    """Angular acceleration of pendulum `index`, rad/s^2, with the share of `term` added."""


@by_type("term")
def driven_slope(slopes: Slopes, index: int, angle: float, rate: float, term: Any) -> Any:
    """Partial derivatives of `driven` by angle and rate."""


@registered("motion", type(None))
def _still(time: float, term: None) -> None:
    return None


@registered("driven", type(None))
def _undriven(acceleration: float, index: int, angle: float, rate: float, term: None) -> float:
    return acceleration


@registered("driven_slope", type(None))
def _undriven_slope(slopes: Slopes, index: int, angle: float, rate: float, term: None) -> Slopes:
    return slopes


@registered("driven", Both)
def _both(acceleration: float, index: int, angle: float, rate: float, term: Both) -> Any:
    return driven(driven(acceleration, index, angle, rate, term.first), index, angle, rate, term.second)


@registered("driven_slope", Both)
def _both_slopes(slopes: Slopes, index: int, angle: float, rate: float, term: Both) -> Any:
    return driven_slope(driven_slope(slopes, index, angle, rate, term.first), index, angle, rate, term.second)
