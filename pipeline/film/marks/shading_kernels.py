"""What a gap's fit is made of: curves drawn on a piece of film, the piece itself, and small normal equations."""

from __future__ import annotations

import math

from pipeline.arrays import Floats
from pipeline.film.marks.curve_kernels import REACH, draw, place
from synth.kernels.compiled import kernel

PARAMETERS = 6
STEP = 1.0  # spots between spots drawn: their sum is even to 1e-8
FLANK = 8.0  # spots of line on either side of the gap


@kernel
def clear(layers: Floats, first: int, stop: int, rows: int, columns: int) -> None:
    """Blank the used part of some layers."""
    for k in range(first, stop):
        for y in range(rows):
            for x in range(columns):
                layers[k, y, x] = 0.0


@kernel
def shade(
    image: Floats,
    across: Floats,
    along: Floats,
    top: int,
    left: int,
    course: Floats,
    slope: Floats,
    begin: float,
    end: float,
    shift: float,
    lead: float,
    spot: float,
    sloped: bool,
) -> None:
    """Draw a curve from row `begin` to `end`, moved by `shift` across and by `lead` rows earlier along the film.

    If `sloped`, the derivatives of its light by `shift` and `lead` are drawn too.
    """
    _rows, columns = image.shape
    reach = REACH * spot
    row = begin
    while row < end:
        column, lean = place(course, slope, row)
        if math.isnan(column):
            row += 0.5
            continue
        step = STEP * spot / math.sqrt(1.0 + lean * lean)
        _, ahead = place(course, slope, row + step)
        if abs(ahead) > abs(lean):  # out of a turning point the line steepens within a step
            step = STEP * spot / math.sqrt(1.0 + ahead * ahead)
        step = min(step, end - row)
        middle = row + 0.5 * step
        column, lean = place(course, slope, middle)
        if not math.isnan(column):
            column += shift + lead * lean
            if left - reach < column < left + columns + reach:
                draw(image, across, along, top, left, middle, column, lean, step, spot, sloped)
        row += step


@kernel
def solve(normal: Floats, right: Floats, size: int) -> bool:
    """Gauss-Jordan in place: `normal` becomes its inverse, `right` the solution; False if singular."""
    for i in range(size):
        pivot = normal[i, i]
        if not pivot > 0.0:
            return False
        for j in range(size):
            if j != i:
                factor = normal[j, i] / pivot
                for k in range(size):
                    if k != i:
                        normal[j, k] -= factor * normal[i, k]
                right[j] -= factor * right[i]
                normal[j, i] = -factor
        for k in range(size):
            if k != i:
                normal[i, k] /= pivot
        right[i] /= pivot
        normal[i, i] = 1.0 / pivot
    return True


@kernel
def window(course: Floats, slope: Floats, mark: float, width: float, spot: float, box: Floats) -> bool:
    """Bounding box of a gap and its flanks: first row, last, first column, last; False where the curve ends."""
    box[0], box[1], box[2], box[3] = 1e9, -1e9, 1e9, -1e9
    for side in range(2):
        sign = 2.0 * side - 1.0
        row, way, inside = mark, 0.0, 0.5 * width
        while True:
            column, lean = place(course, slope, row)
            if math.isnan(column):
                return False
            box[0], box[1] = min(box[0], row), max(box[1], row)
            box[2], box[3] = min(box[2], column), max(box[3], column)
            if way >= FLANK * spot:
                break
            step = STEP * spot / math.sqrt(1.0 + lean * lean)
            if inside > 0.0:
                step = min(step, inside)
                inside -= step
            else:
                way += STEP * spot
            row += sign * step
    pad = 2.5 * spot
    box[0], box[1], box[2], box[3] = box[0] - pad, box[1] + pad, box[2] - pad, box[3] + pad
    return True
