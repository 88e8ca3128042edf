"""First crossing of zero by a polynomial in Bernstein form on [0, 1], found with certainty.

The number of sign changes in the Bernstein coefficients bounds the number of roots (Descartes): none means no
crossing, one means exactly one; more, and the interval is halved (de Casteljau). A touch without crossing
ends as an interval too short to split and is no crossing; a double crossing within a step is seen as two.
"""

from __future__ import annotations

from math import comb

import numpy as np

from synth.kernels.compiled import kernel
from synth.phase import Floats

DEGREE = 7
NONE = 2.0
_TURN_HALVINGS = 30  # the value at a turn errs by the square of 2^-30
_SHORTEST = 2.0**-48  # of a step: roots closer than this differ by rounding only


@kernel
def sign(value: float) -> int:
    """-1, 0 or 1."""
    return int(value > 0.0) - int(value < 0.0)


@kernel
def changes(coefficients: Floats, row: int, before: int) -> int:
    """Number of sign changes in one row of coefficients; zeros are skipped, a leading one takes the sign `before`."""
    count = 0
    last = before
    if coefficients[row, 0] != 0.0:
        last = sign(coefficients[row, 0])
    for j in range(1, DEGREE + 1):
        now = sign(coefficients[row, j])
        if now != 0:
            if last != 0 and now != last:
                count += 1
            last = now
    return count


@kernel
def halve(coefficients: Floats, row: int) -> None:
    """Split a row at its middle: the right half stays in `row`, the left half goes to `row + 1`."""
    for level in range(DEGREE + 1):
        coefficients[row + 1, level] = coefficients[row, 0]
        for j in range(DEGREE - level):
            coefficients[row, j] = 0.5 * (coefficients[row, j] + coefficients[row, j + 1])
    # what is left on the triangle's other side is the right half, in order


@kernel
def value_and_slope(coefficients: Floats, row: int, share: float, work: Floats) -> tuple[float, float]:
    """Polynomial and derivative at `share` of the row's own interval (de Casteljau, stable)."""
    rest = 1.0 - share
    for j in range(DEGREE + 1):
        work[j] = coefficients[row, j]
    for level in range(DEGREE - 1):
        for j in range(DEGREE - level):
            work[j] = rest * work[j] + share * work[j + 1]
    return rest * work[0] + share * work[1], DEGREE * (work[1] - work[0])


@kernel
def polish(coefficients: Floats, row: int, rising: int, work: Floats) -> float:
    """The only crossing within a row's interval, to rounding: Newton inside a bracket that halves when it must.

    A zero at the left end is the crossing if the polynomial leaves it to the side it crosses to; otherwise it is the
    crossing before, and this one is further on.
    """
    left, right = 0.0, 1.0
    first, last = coefficients[row, 0], coefficients[row, DEGREE]
    share = first / (first - last) if first != last else 0.5
    if first == 0.0:
        for j in range(1, DEGREE + 1):
            leaving = sign(coefficients[row, j])
            if leaving == rising:
                return 0.0
            if leaving != 0:
                break
        share = 0.5
    for _ in range(100):
        value, slope = value_and_slope(coefficients, row, share, work)
        if value * rising < 0.0:
            left = share
        else:
            right = share
        if slope * rising > 0.0:
            guess = share - value / slope
        else:
            guess = 0.5 * (left + right)
        if not left <= guess <= right:
            guess = 0.5 * (left + right)
        if abs(guess - share) <= 1e-16:
            return guess
        share = guess
    return share


@kernel
def first_crossing(coefficients: Floats, lefts: Floats, work: Floats, before: int, direction: int) -> float:
    """Share of the first crossing in `direction` (+1 rising, -1 falling, 0 either), or 2.0 for none.

    Row 0 of `coefficients` (60, 8) holds the polynomial and is used up; the other rows, `lefts` (60, 2: left end and
    width of each row's interval) and `work` (8,) are working space. `before` is the sign of the polynomial just before
    the interval, for a start at zero exactly.
    """
    lefts[0, 0] = 0.0
    lefts[0, 1] = 1.0
    row = 0
    last = before
    while row >= 0:
        count = changes(coefficients, row, last)
        if count > 1 and lefts[row, 1] > _SHORTEST:
            halve(coefficients, row)
            half = 0.5 * lefts[row, 1]
            lefts[row + 1, 0] = lefts[row, 0]
            lefts[row + 1, 1] = half
            lefts[row, 0] += half
            lefts[row, 1] = half
            row += 1
            continue
        end = sign(coefficients[row, DEGREE])
        if count % 2 == 1 and (direction == 0 or end == direction):
            return lefts[row, 0] + lefts[row, 1] * polish(coefficients, row, end, work)
        if end != 0:
            last = end
        row -= 1
    return NONE


@kernel
def margin(coefficients: Floats, work: Floats) -> float:
    """|value| of row 0 where it turns round within the interval: how near it comes to a touch; inf if it does not turn."""
    rise = sign(coefficients[0, 1] - coefficients[0, 0])
    if rise * sign(coefficients[0, DEGREE] - coefficients[0, DEGREE - 1]) >= 0:
        return np.inf
    left, right = 0.0, 1.0
    for _ in range(_TURN_HALVINGS):
        middle = 0.5 * (left + right)
        _, slope = value_and_slope(coefficients, 0, middle, work)
        if slope * rise > 0.0:
            left = middle
        else:
            right = middle
    value, _ = value_and_slope(coefficients, 0, right, work)
    return abs(value)


def _bernstein() -> Floats:
    """Bernstein coefficients of x^a (1-x)^b, the terms of the dense output."""
    powers = ((1, 0), (1, 1), (2, 1), (2, 2), (3, 2), (3, 3), (4, 3))
    table = np.zeros((7, DEGREE + 1))
    for term, (a, b) in enumerate(powers):
        free = DEGREE - a - b
        for j in range(free + 1):
            table[term, a + j] = comb(free, j) / comb(DEGREE, a + j)
    return table


TO_BERNSTEIN = _bernstein()
"""(7, 8): from the coefficients of the dense output, less the state at the step's start."""
