"""Terms of an equation of motion, composed by TYPE: what a scene leaves out is `None` and compiles to nothing.

Two questions are put to a term, and each is answered by the kernel that the term's type was registered with:

    motion(time, term)                                   -> acceleration of the support, or None
    driven(acceleration, index, angle, rate, term)       -> acceleration with the term's share added

`Both(first, second)` is the sum of two terms; `together(...)` folds any number of them.

In the frame of a ship every mass feels `-m x''` sideways and `-m z''` upwards (z'' up positive). A bob's share along
its swing is `(g + z'') sin phi + x'' cos phi` (`weight`); the rest acts on what holds the pendulums (`carried`).

The ship's motion is a sum of harmonics, `sum a_k cos(w_k t + phase_k)` (`Harmonics`). The cosine of a long phase is
only as good as the phase: w t of 25 000 rad as a double errs by 4e-12. The phase is therefore counted in turns, as
exact products of halves, whole turns dropped, and the cosine of the rest summed as a polynomial without any branch.

A system that has `kicks` (`Impulses`) halts a step at each; for `kicks = None` nothing is compiled.
"""

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import ArrayLike

from synth.kernels.compiled import kernel, summing_kernel
from synth.phase import Floats, full_turn
from synth.systems.dispatch import by_type, registered, taken_in

_TURN = full_turn(Fraction(1))  # 2 pi
_SPLIT = 134217729.0  # 2^27 + 1: Veltkamp's constant for halves of 26 bits


class Both(NamedTuple):
    """The sum of two terms, either of which may be a sum again."""

    first: Any
    second: Any


def together(*terms: Any) -> Any:
    """Fold terms into nested pairs; no term at all is `None`."""
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

    step: float  # s
    kept: Floats  # (impulses, pendulums) what stays of angle and rate
    angles: Floats  # (impulses, pendulums) what is added to the angle, rad
    rates: Floats  # and to the rate, rad/s


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


class Harmonics(NamedTuple):
    """Amplitudes, frequencies and phases in one table: each further array would cost 10 ns in every call."""

    table: Floats
    """(5, harmonics): amplitude in m/s^2; frequency in turns a second as the sum of its first 26 bits, the next 26, and
    what is left; phase in turns, within half a turn of zero."""


def harmonics(amplitude: ArrayLike, angular_frequency: ArrayLike, phase: ArrayLike) -> Harmonics:
    """Build the term from amplitudes in m/s^2, circular frequencies in rad/s and phases in rad."""
    columns = [np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in (amplitude, angular_frequency, phase)]
    size, rate, start = (np.ascontiguousarray(column) for column in np.broadcast_arrays(*columns))
    parts = np.empty((3, size.size))
    for row, value in enumerate(rate):
        turns = Fraction(float(value)) / _TURN
        for part in range(2):
            head = float(turns) * _SPLIT
            head = head - (head - float(turns))
            parts[part, row] = head
            turns -= Fraction(head)
        parts[2, row] = float(turns)
    offset = np.array([float(Fraction(float(value)) / _TURN % 1) for value in start])
    return Harmonics(np.array([size, *parts, offset - np.rint(offset)]))


# Taylor series of cos and sin of 2 pi x for |x| <= 1/8, folded from |x| <= 1/2; the first term left out is below 1e-17
_COSINE = tuple((-1.0) ** k * float(_TURN ** (2 * k) / math.factorial(2 * k)) for k in range(9))
_SINE = tuple((-1.0) ** k * float(_TURN ** (2 * k + 1) / math.factorial(2 * k + 1)) for k in range(8))


@kernel
def _cosine(turn: float) -> float:
    """cos(2 pi turn), right to 2e-16; even in `turn` by construction, free of branches."""
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = _COSINE
    s0, s1, s2, s3, s4, s5, s6, s7 = _SINE
    fold = abs(turn - np.rint(turn))  # [0, 1/2]
    near = min(fold, 0.5 - fold)  # cos 2 pi (1/2 - x) = -cos 2 pi x: [0, 1/4]
    aside = 0.25 - near
    p = near * near
    q = aside * aside
    upper = c4 + p * (c5 + p * (c6 + p * (c7 + p * c8)))
    cosine = c0 + p * (c1 + p * (c2 + p * (c3 + p * upper)))
    upper = s4 + q * (s5 + q * (s6 + q * s7))
    sine = aside * (s0 + q * (s1 + q * (s2 + q * (s3 + q * upper))))
    value = cosine if near < 0.125 else sine
    return value if fold < 0.25 else -value


@kernel
def _turn(coarse: float, fine: float, rest: float, head: float, tail: float) -> float:
    """Turns since time 0, whole ones dropped; the first three products are exact."""
    first = coarse * head
    second = coarse * tail
    third = fine * head
    whole = (first - np.rint(first)) + ((second - np.rint(second)) + (third - np.rint(third)))
    return whole + (fine * tail + rest * (head + tail))


@kernel
def _head(time: float) -> float:
    """First 26 bits of the time."""
    scaled = time * _SPLIT
    return scaled - (scaled - time)


@registered("motion", Harmonics)
def _motion(time: float, term: Harmonics) -> float:
    return _level(time, term)  # a kernel, not taken in: its sums may be reordered


@summing_kernel
def _level(time: float, term: Harmonics) -> float:
    """Acceleration at `time`, m/s^2; the exact products are in kernels whose sums may not be reordered."""
    head = _head(time)
    tail = time - head
    table = term.table
    total = 0.0
    for k in range(table.shape[1]):
        turn = _turn(table[1, k], table[2, k], table[3, k], head, tail)
        total += table[0, k] * _cosine(turn + table[4, k])
    return total
