"""Joint least squares of all traces that overlap on one row: windows about the traces, groups of those that overlap.

Darkness is a known function f of exposure, exposures of several lines add up, and grain is known per darkness:

    y(u) = background + f(sum_k brightness_k E_k(u - shift_k)) + noise of variance v0 + v1 f.

Where a trace turns, what lies on a row depends as much on when it turned as on where: the slope of its course may be
wrong by what the course is uncertain, and the fit allows for it.

Fitted in darkness, where the grain is normal, and not in exposure, where the toe of the curve would bend it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import STEP, Lens
from pipeline.film.tracking.line_profile import MOST_NODES, REACH, nodes_of, profile
from pipeline.film.tracking.motion import slope_of, solve
from synth.kernels.compiled import kernel, summing_kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

OUTLIER = 3.5  # sigma from which on a pixel counts less
FAINTEST = 0.02
ROUNDS = 4
BRIGHTNESS_PRIOR = 0.7  # 1 sigma of what is known of the brightness before, relative
WINDOW = 3.5  # spots beyond the outermost light
SETTLED = 0.03


class Work(NamedTuple):
    """The fit of a row and its work space.

    Attributes
    ----------
    fit : (traces, 6) array
        Shift, its variance, brightness, its variance, mean square residual in units of the noise, variance of the
        shift if the trace lay alone; variances are inf where a trace is not known or off the image.
    """

    fit: Floats
    nodes: Floats  # (traces, 3, MOST_NODES), see `line_profile.nodes_of`
    counts: Integers
    windows: Integers  # (traces, 4): first column and the one behind the last, group, members of a group
    profiles: Floats  # (traces, 3, columns), see `line_profile.profile`
    design: Floats  # (3 traces + 1, columns): what a change of each unknown adds to each pixel
    pixels: Floats  # (5, columns): exposure, residual, weight, square of the residual over its noise, a product
    matrices: Floats


@kernel
def work_space(traces: int, columns: int) -> Work:
    """Arrays for the fit of rows."""
    return Work(
        np.empty((traces, 6)), np.empty((traces, 3, MOST_NODES)), np.empty(traces, np.int64),
        np.empty((traces, 4), np.int64), np.empty((traces, 3, columns)),
        np.empty((3 * traces + 1, columns)), np.empty((5, columns)), np.empty((3, 3 * traces + 8, 3 * traces + 8)),
    )  # fmt: skip


@summing_kernel
def _normal_equations(design: Floats, pixels: Floats, size: int, normal: Floats, right: Floats) -> None:
    """Of `right.size` unknowns and so many pixels; the lower half of the matrix."""
    residual, weight, weighed = pixels[1], pixels[2], pixels[4]
    for a in range(right.size):
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
            normal[a, b] = product


@summing_kernel
def _misfit(square: Floats, profile: Floats, size: int) -> float:
    """Mean square residual of the pixels where a trace lies."""
    total, light = 0.0, 1e-12
    for i in range(size):
        total += square[i] * profile[i]
        light += profile[i]
    return total / light


@kernel
def _fit_group(
    darkness: Floats32, first: int, members: Integers, lens: Lens, lamp: Floats, prior: Floats, settled: float,
    work: Work,
) -> None:  # fmt: skip
    """Fit the traces of one group to the pixels from column `first` on (see `read_row`)."""
    spot, table, fit, profiles, design = lens.spot, lens.table, work.fit, work.profiles, work.design
    blank, growth = lens.grain[0], lens.grain[1]
    size, g = darkness.size, members.size
    n = 3 * g + 1
    top = table.shape[1] - 2
    normal, copy, rows = work.matrices[0, :n, :n], work.matrices[1], work.matrices[2]
    value, right, other, start, limit = rows[0], rows[1], rows[2], rows[3], rows[4]
    exposure, residual, weight, square = work.pixels[0], work.pixels[1], work.pixels[2], work.pixels[3]
    value[:n] = 0.0
    for a in range(g):
        value[3 * a + 1] = lamp[members[a]]
    offset_variance = 0.25 * blank
    for _ in range(ROUNDS):
        exposure[:size] = 0.0
        for a in range(g):
            k, lit = members[a], value[3 * a + 1]
            profile(work.nodes[k], work.counts[k], value[3 * a], value[3 * a + 2], spot, first, profiles[k], size)
            peak = 0.02
            for i in range(size):
                exposure[i] += lit * profiles[k, 0, i]
                peak = max(peak, profiles[k, 0, i])
            limit[a] = 1.5 * spot / peak
        start[:n] = value[:n]
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
            k, lit = members[a], value[3 * a + 1]
            for i in range(size):
                design[3 * a, i] = rates[i] * lit * profiles[k, 1, i]
                design[3 * a + 1, i] = rates[i] * profiles[k, 0, i]
                design[3 * a + 2, i] = rates[i] * lit * profiles[k, 2, i]
        rates[:size] = 1.0
        _normal_equations(design, work.pixels, size, normal, right[:n])
        for a in range(g):
            wide = BRIGHTNESS_PRIOR * lamp[members[a]]
            normal[3 * a + 1, 3 * a + 1] += 1.0 / (wide * wide)
            right[3 * a + 1] += (lamp[members[a]] - value[3 * a + 1]) / (wide * wide)
            normal[3 * a, 3 * a] += 1e-9
            normal[3 * a + 2, 3 * a + 2] += 1.0 / prior[members[a], 1]
            right[3 * a + 2] -= value[3 * a + 2] / prior[members[a], 1]
        normal[n - 1, n - 1] += 1.0 / offset_variance
        right[n - 1] -= value[n - 1] / offset_variance
        for a in range(n):
            for b in range(a):
                normal[b, a] = normal[a, b]
        if not _solve_with_priors(normal, right, value, members, prior, -1, copy, other):
            break
        moved = 0.0
        for a in range(g):
            step = min(max(other[3 * a], -limit[a]), limit[a])
            value[3 * a] += step
            value[3 * a + 2] += other[3 * a + 2]
            value[3 * a + 1] = max(value[3 * a + 1] + other[3 * a + 1], FAINTEST * lamp[members[a]])
            moved = max(moved, abs(step) / limit[a], 0.3 * abs(other[3 * a + 1]) / lamp[members[a]])
        value[n - 1] += other[n - 1]
        if moved < settled:
            break
    for a in range(g):  # each trace's own reading: the others with what was known of them, itself without
        k = members[a]
        if _solve_with_priors(normal, right, start, members, prior, a, copy, other):
            fit[k, 0] = start[3 * a] + min(max(other[3 * a], -limit[a]), limit[a])
            fit[k, 1] = copy[3 * a, 3 * a]
        else:
            fit[k, 0], fit[k, 1] = 0.0, np.inf
        fit[k, 2] = value[3 * a + 1]
        fit[k, 3] = copy[3 * a + 1, 3 * a + 1]
        fit[k, 4] = _misfit(square, profiles[k, 0], size)
        fit[k, 5] = fit[k, 1]
        if g > 1:
            for i in range(4):
                for j in range(4):
                    copy[i, j] = normal[n - 1 if i == 3 else 3 * a + i, n - 1 if j == 3 else 3 * a + j]
            fit[k, 5] = copy[0, 0] if solve(copy, other, 4) else np.inf


@kernel
def _solve_with_priors(
    normal: Floats, right: Floats, value: Floats, members: Integers, prior: Floats, without: int, copy: Floats,
    other: Floats,
) -> bool:  # fmt: skip
    """Inverse and step, into `copy` and `other`, with the priors of all shifts but that of member `without`."""
    n = normal.shape[0]
    copy[:n, :n], other[:n] = normal, right[:n]
    for a in range(members.size):
        if a != without:
            copy[3 * a, 3 * a] += 1.0 / prior[members[a], 0]
            other[3 * a] -= value[3 * a] / prior[members[a], 0]
    return solve(copy, other, n)


@kernel
def read_row(
    darkness: Floats32, row: float, states: Floats, alive: Integers, lens: Lens, lamp: Floats, prior: Floats,
    gaps: Floats, gap_of: Integers, settled: float, work: Work,
) -> None:  # fmt: skip
    """Shift and brightness of all traces on one row, into `work`.

    Parameters
    ----------
    darkness : (columns,) array
        Above blank film; NaN where nothing is to be read: the brightness of a trace that meets it is NaN.
    row : float
        Centre line of the row, px.
    states, alive : (traces, 6), (traces,) arrays
        Of the motion at this row; `alive` is 0 where a trace is not known.
    lamp : (traces,) array
        Brightness to start from.
    prior : (traces, 2) array
        Variance of the shift as known before, for the sake of the OTHER traces of the group (inf for none), and of the
        slope.
    gaps, gap_of : (n, 2), (traces + 1,) array
        Gaps of all traces; those of trace k from `gap_of[k]` to before `gap_of[k + 1]`.
    settled : float
        Last step, over 1.5 spots of the normal, at which to stop.
    """
    fit, nodes, counts, windows = work.fit, work.nodes, work.counts, work.windows
    spot = lens.spot
    traces, columns = states.shape[0], darkness.size
    for k in range(traces):
        fit[k] = 0.0
        fit[k, 1], fit[k, 3], fit[k, 5] = np.inf, np.inf, np.inf
        windows[k, 2] = -1
        if alive[k] == 0:
            continue
        near, last = gap_of[k], gap_of[k + 1]
        while near < last and gaps[near, 1] < row - 8.0 * spot:
            near += 1
        counts[k] = nodes_of(states[k], spot, lens.shear, gaps[near:last], row, nodes[k])
        low, high = lit_columns(nodes[k], counts[k], 0.01 * nodes[k, 1, 0] * math.exp(0.5 * REACH * REACH))
        if not low <= high:
            continue
        windows[k, 0] = max(0, math.floor(low - WINDOW * spot))
        windows[k, 1] = min(columns, math.ceil(high + WINDOW * spot))
        here = states[k, 0] + states[k, 3]
        if here > 0.0 and here < columns and windows[k, 1] - windows[k, 0] >= 6:
            windows[k, 2] = k
    for _ in range(traces):  # the smallest number of a group is its name
        for a in range(traces):
            for b in range(traces):
                together = windows[a, 0] < windows[b, 1] and windows[b, 0] < windows[a, 1]
                if windows[a, 2] > windows[b, 2] >= 0 and together:
                    windows[a, 2] = windows[b, 2]
    for name in range(traces):
        count, low_pixel, high_pixel = 0, columns, 0
        for k in range(traces):
            if windows[k, 2] == name:
                windows[count, 3] = k
                count += 1
                low_pixel, high_pixel = min(low_pixel, windows[k, 0]), max(high_pixel, windows[k, 1])
        if count > 0:
            pixels, members = darkness[low_pixel:high_pixel], windows[:count, 3]
            total = np.float32(0.0)
            for value in pixels:
                total += value
            if not math.isnan(total):
                _fit_group(pixels, low_pixel, members, lens, lamp, prior, settled, work)
                continue
            for k in members:  # nothing is to be read here
                fit[k, 2] = math.nan


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


@kernel
def read_piece(
    darkness: Floats32, first: int, states: Floats, known: NDArray[np.uint8], slope_variance: Floats, lamp: Floats,
    gaps: Floats, gap_of: Integers, lens: Lens,
) -> Floats:  # fmt: skip
    """Read all traces row by row from row `first` of the film on: `Work.fit` of each row and slope, (traces, rows, 7).

    `states` (rows, traces, 6) and `slope_variance` (traces, rows) are those of the course, `lamp` (traces, rows) the
    brightness in the open; the brightness that is read is that of the light let through.
    """
    rows, columns = darkness.shape
    traces = states.shape[1]
    work, out = work_space(traces, columns), np.empty((traces, rows, 7))
    alive, now, prior = np.empty(traces, np.int64), np.empty(traces), np.full((traces, 2), math.inf)
    for i in range(rows):
        for k in range(traces):
            alive[k], now[k] = (1 if known[k, i] else 0), lamp[k, i]
            prior[k, 1] = max(slope_variance[k, i], 1e-8)
        read_row(darkness[i], first + i + 0.5, states[i], alive, lens, now, prior, gaps, gap_of, SETTLED, work)
        for k in range(traces):
            out[k, i, :6] = work.fit[k]
            out[k, i, 6] = slope_of(states[i, k], lens.shear)
    return out
