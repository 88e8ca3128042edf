"""Joint least squares of all traces that overlap on one row: windows about the traces, groups of those that overlap.

Darkness is a known function f of exposure, exposures of several lines add up, and grain is known per darkness:

    y(u) = background + f(sum_k brightness_k E_k(u - shift_k)) + noise of variance v0 + v1 f.

Where a trace turns, its slope may be wrong by what the course is uncertain, and the fit allows for it. Fitted in
darkness, where the grain is normal, and not in exposure, where the toe of the curve would bend it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import STEP, Lens
from pipeline.film.tracking.motion import MOST_NODES, REACH, nodes_of, profile, slope_of, solve
from synth.kernels.compiled import kernel, making_kernel, summing_kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

OUTLIER = 3.5  # sigma from which on a pixel counts less
FAINTEST = 0.02
ROUNDS = 4
BRIGHTNESS_PRIOR = 0.7  # 1 sigma of what is known of the brightness before, relative
WINDOW = 3.5  # spots beyond the outermost light
SETTLED = 0.03


@summing_kernel
def _normal_equations(design: Floats, pixels: Floats, normal: Floats, right: Floats) -> None:
    """Of the unknowns whose changes add the rows of `design` to the pixels; see `_fit_group`."""
    unknowns, size = design.shape
    residual, weight, weighed = pixels[1], pixels[2], pixels[4]
    for a in range(unknowns):
        row = design[a]
        total = 0.0
        for i in range(size):
            weighed[i] = weight[i] * row[i]
            total += weighed[i] * residual[i]
        right[a] = total
        for b in range(a + 1):
            other, product = design[b], 0.0
            for i in range(size):
                product += weighed[i] * other[i]
            normal[a, b], normal[b, a] = product, product


@summing_kernel
def _misfit(square: Floats, light: Floats) -> float:
    """Mean square residual of the pixels where a trace lies."""
    total, whole = 0.0, 1e-12
    for i in range(light.size):
        total += square[i] * light[i]
        whole += light[i]
    return total / whole


@making_kernel
def _fit_group(
    darkness: Floats32, first: int, members: Integers, nodes: Floats, counts: Integers, lens: Lens, lamp: Floats,
    prior: Floats, settled: float, fit: Floats,
) -> None:  # fmt: skip
    """Fit the traces of one group to the pixels from column `first` on (see `read_row`)."""
    spot, table = lens.spot, lens.table
    blank, growth = lens.grain[0], lens.grain[1]
    size, g = darkness.size, members.size
    n, top = 3 * g + 1, table.shape[1] - 2
    profiles, design = np.empty((g, 3, size)), np.empty((n, size))
    pixels, normal, vectors = np.empty((5, size)), np.empty((n, n)), np.zeros((4, n))
    exposure, residual, weight, square = pixels[0], pixels[1], pixels[2], pixels[3]
    right, value, start, limit = vectors[0], vectors[1], vectors[2], vectors[3]
    for a in range(g):
        value[3 * a + 1] = lamp[members[a]]
    offset_variance = 0.25 * blank
    for _ in range(ROUNDS):
        start[:], exposure[:] = value, 0.0
        for a in range(g):
            k, lit, peak = members[a], value[3 * a + 1], 0.02
            profile(nodes[k], counts[k], value[3 * a], value[3 * a + 2], spot, first, profiles[a])
            for i in range(size):
                exposure[i] += lit * profiles[a, 0, i]
                peak = max(peak, profiles[a, 0, i])
            limit[a] = 1.5 * spot / peak
        rates = design[n - 1]
        for i in range(size):
            place = exposure[i] * (1.0 / STEP)
            index = min(int(place), top)
            share = min(place - index, 1.0)
            dark = table[0, index] + share * (table[0, index + 1] - table[0, index])
            rates[i] = table[1, index] + share * (table[1, index + 1] - table[1, index])
            residual[i] = darkness[i] - value[n - 1] - dark
            weight[i] = 1.0 / (blank + growth * dark)
            square[i] = residual[i] * residual[i] * weight[i]
            if square[i] > OUTLIER * OUTLIER:
                weight[i] *= OUTLIER / math.sqrt(square[i])
        for a in range(g):
            lit = value[3 * a + 1]
            for i in range(size):
                design[3 * a, i] = rates[i] * lit * profiles[a, 1, i]
                design[3 * a + 1, i] = rates[i] * profiles[a, 0, i]
                design[3 * a + 2, i] = rates[i] * lit * profiles[a, 2, i]
        rates[:] = 1.0
        _normal_equations(design, pixels, normal, right)
        for a in range(g):
            usual = lamp[members[a]]
            wide = BRIGHTNESS_PRIOR * usual
            normal[3 * a + 1, 3 * a + 1] += 1.0 / (wide * wide)
            right[3 * a + 1] += (usual - value[3 * a + 1]) / (wide * wide)
            normal[3 * a, 3 * a] += 1e-9
            normal[3 * a + 2, 3 * a + 2] += 1.0 / prior[members[a], 1]
            right[3 * a + 2] -= value[3 * a + 2] / prior[members[a], 1]
        normal[n - 1, n - 1] += 1.0 / offset_variance
        right[n - 1] -= value[n - 1] / offset_variance
        known, _, step = _solve_with_priors(normal, right, value, members, prior, -1)
        if not known:
            break
        moved = 0.0
        for a in range(g):
            usual, shift = lamp[members[a]], min(max(step[3 * a], -limit[a]), limit[a])
            value[3 * a] += shift
            value[3 * a + 2] += step[3 * a + 2]
            value[3 * a + 1] = max(value[3 * a + 1] + step[3 * a + 1], FAINTEST * usual)
            moved = max(moved, abs(shift) / limit[a], 0.3 * abs(step[3 * a + 1]) / usual)
        value[n - 1] += step[n - 1]
        if moved < settled:
            break
    for a in range(g):  # each trace's own reading: the others with what was known of them, itself without
        k = members[a]
        known, inverse, step = _solve_with_priors(normal, right, start, members, prior, a)
        fit[k, 0], fit[k, 1] = 0.0, np.inf
        if known:
            fit[k, 0] = start[3 * a] + min(max(step[3 * a], -limit[a]), limit[a])
            fit[k, 1] = inverse[3 * a, 3 * a]
        fit[k, 2], fit[k, 3] = value[3 * a + 1], inverse[3 * a + 1, 3 * a + 1]
        fit[k, 4], fit[k, 5] = _misfit(square, profiles[a, 0]), fit[k, 1]
        if g > 1:
            alone = np.empty((4, 4))
            for i in range(4):
                for j in range(4):
                    alone[i, j] = normal[n - 1 if i == 3 else 3 * a + i, n - 1 if j == 3 else 3 * a + j]
            fit[k, 5] = alone[0, 0] if solve(alone, step, 4) else np.inf


@making_kernel
def _solve_with_priors(
    normal: Floats, right: Floats, value: Floats, members: Integers, prior: Floats, without: int
) -> tuple[bool, Floats, Floats]:
    """Whether there are inverse and step, and both, with the priors of all shifts but that of member `without`."""
    inverse, step = normal.copy(), right.copy()
    for a in range(members.size):
        if a != without:
            inverse[3 * a, 3 * a] += 1.0 / prior[members[a], 0]
            step[3 * a] -= value[3 * a] / prior[members[a], 0]
    return solve(inverse, step, step.size), inverse, step


@making_kernel
def read_row(
    darkness: Floats32, row: float, states: Floats, alive: Integers, lens: Lens, lamp: Floats, prior: Floats,
    gaps: Floats, gap_of: Integers, settled: float,
) -> Floats:  # fmt: skip
    """Fit all traces to the row with centre line `row`, px.

    Returns (traces, 6): shift, its variance, brightness, its variance, mean square residual in units of the noise, and
    variance of the shift if the trace lay alone; variances are inf where a trace is not known or off the image.

    `darkness` (columns,) is NaN where nothing is to be read, and so then is a brightness. `states` (traces, 6) are at
    this row, `alive` 0 where unknown, `lamp` the brightness to start from; `prior` (traces, 2) are variances of the
    shift, for the other traces' sake, and of the slope; `gaps` (n, 2) trace k's from `gap_of[k]` to `gap_of[k + 1]`.
    """
    spot, traces, columns = lens.spot, states.shape[0], darkness.size
    fit, nodes, counts = np.zeros((traces, 6)), np.empty((traces, 3, MOST_NODES)), np.empty(traces, np.int64)
    begin, stop, group = np.zeros(traces, np.int64), np.zeros(traces, np.int64), np.full(traces, -1)
    for k in range(traces):
        fit[k, 1], fit[k, 3], fit[k, 5] = np.inf, np.inf, np.inf
        if alive[k] == 0:
            continue
        counts[k] = nodes_of(states[k], spot, lens.shear, gaps[gap_of[k] : gap_of[k + 1]], row, nodes[k])
        low, high = lit_columns(nodes[k], counts[k], 0.01 * nodes[k, 1, 0] * math.exp(0.5 * REACH * REACH))
        if not low <= high:
            continue
        begin[k], stop[k] = max(0, math.floor(low - WINDOW * spot)), min(columns, math.ceil(high + WINDOW * spot))
        here = states[k, 0] + states[k, 3]
        if here > 0.0 and here < columns and stop[k] - begin[k] >= 6:
            group[k] = k
    for _ in range(traces):  # the smallest number of a group is its name
        for a in range(traces):
            for b in range(traces):
                if group[a] > group[b] >= 0 and begin[a] < stop[b] and begin[b] < stop[a]:
                    group[a] = group[b]
    for name in range(traces):
        members = np.flatnonzero(group == name)
        if members.size == 0:
            continue
        first = int(begin[members].min())
        pixels = darkness[first : stop[members].max()]
        if not math.isnan(pixels.sum()):
            _fit_group(pixels, first, members, nodes, counts, lens, lamp, prior, settled, fit)
            continue
        for each in members:  # nothing is to be read here
            fit[each, 2] = math.nan
    return fit


@kernel
def lit_columns(nodes: Floats, count: int, least: float) -> tuple[float, float]:
    """Columns between which nodes have at least so much weight; (1e9, -1e9) where none has, or they lie far off."""
    low, high = 1e9, -1e9
    for i in range(count):
        if nodes[1, i] >= least:
            low, high = min(low, nodes[0, i]), max(high, nodes[0, i])
    if low > -1e6 and high < 1e6:
        return low, high
    return 1e9, -1e9


@making_kernel
def read_piece(
    darkness: Floats32, first: int, states: Floats, known: NDArray[np.uint8], slope_variance: Floats, lamp: Floats,
    gaps: Floats, gap_of: Integers, lens: Lens,
) -> Floats:  # fmt: skip
    """Read rows from `first` on by courses `states` (rows, traces, 6): `read_row` and slope, (traces, rows, 7)."""
    rows, traces = states.shape[:2]
    out = np.empty((traces, rows, 7))
    alive, now, prior = np.empty(traces, np.int64), np.empty(traces), np.full((traces, 2), math.inf)
    for i in range(rows):
        for k in range(traces):
            alive[k], now[k] = (1 if known[k, i] else 0), lamp[k, i]
            prior[k, 1] = max(slope_variance[k, i], 1e-8)
        fit = read_row(darkness[i], first + i + 0.5, states[i], alive, lens, now, prior, gaps, gap_of, SETTLED)
        for k in range(traces):
            out[k, i, :6] = fit[k]
            out[k, i, 6] = slope_of(states[i, k], lens.shear)
    return out
