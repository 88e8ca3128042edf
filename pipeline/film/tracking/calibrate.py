"""Spot, slit, characteristic curve and grain told from a section whose traces have been followed.

A line's exposure follows from its slope alone (dwell time), and slopes run from 0 at the turning points to the steepest
in the middle: the same film shows the same emulsion at all exposures, and the darkness of the pixels against the
exposure that the spot must have left there is the characteristic curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import ToneCurve
from pipeline.film.tracking.line_profile import MOST_NODES, Optics, nodes_of, profile
from pipeline.film.tracking.section import Section
from synth.kernels.compiled import kernel

NEAR_GAP = 5  # rows beside one that lacks light
LACKING = 0.9
MOST_ROWS = 260
ROUNDS = 12
LEAST_GROWTH = 5e-5  # the model of a line leaves a hundredth or so of its darkness, whatever the grain
STEEPEST_GRAIN = 100.0  # growth of the variance over that on blank film, per unit of darkness
HUBER = 3.0
LEAST_ROWS = 40
SHEAR_SWINGS = 1.5


@kernel
def exposures(
    darkness: NDArray[np.float32],
    rows: NDArray[np.int64],
    traces: NDArray[np.int64],
    states: Floats,
    lamp: Floats,
    spot: float,
    window_spot: float,
    shear: float,
) -> tuple[Floats, Floats]:
    """Exposure that the model leaves on the pixels about some rows of some traces, and their darkness.

    Parameters
    ----------
    rows, traces : (n,) arrays
        Where to look.
    states, lamp : (n, traces, 6), (n, traces) arrays
        Of all traces on those rows; a trace with a lamp of 0 is left out.
    window_spot : float
        Width of the spot for which the windows are chosen.
    """
    columns = darkness.shape[1]
    exposure, seen = np.zeros(rows.size * columns), np.zeros(rows.size * columns)
    nodes, out, gaps = np.empty((3, MOST_NODES)), np.empty((3, columns)), np.empty((0, 2))
    count = 0
    for n in range(rows.size):
        own = traces[n]
        number = nodes_of(states[n, own], window_spot, shear, gaps, 0.0, nodes)
        low, high, least = 1e9, -1e9, 0.01 * nodes[1, number // 2]
        for i in range(number):
            if nodes[1, i] > least:
                low, high = min(low, nodes[0, i]), max(high, nodes[0, i])
        if not (low > -1e6 and high < 1e6):
            continue
        first, stop = max(0, int(low - 4.0 * window_spot)), min(columns, int(high + 4.0 * window_spot))
        size = stop - first
        if size < 4:
            continue
        for i in range(size):
            seen[count + i] = darkness[rows[n], first + i]
        for k in range(states.shape[1]):
            if lamp[n, k] > 0.0:
                number = nodes_of(states[n, k], spot, shear, gaps, 0.0, nodes)
                profile(nodes, number, 0.0, 0.0, spot, first, out[:, :size])
                for i in range(size):
                    exposure[count + i] += lamp[n, k] * out[0, i]
        count += size
    return exposure[:count], seen[:count]


def calibrate(section: Section, optics: Optics) -> Optics:
    """Optics fitted to a section; the ones given where the section says too little."""
    rows, traces, lamp, typical = _chosen_rows(section, optics.spot)
    if rows.size < LEAST_ROWS:
        return optics
    states = section.states[rows].copy()
    read = section.place[:, rows].T
    states[:, :, 0] += np.where(np.isfinite(read), read - states[:, :, 0] - states[:, :, 3], 0.0)
    curve = optics.curve
    optics = optics.with_(curve=ToneCurve(curve.darkest, curve.middle / typical, curve.contrast))
    return _fitted(section.darkness, rows, traces, states, lamp, optics)


def _fitted(
    darkness: NDArray[np.float32],
    rows: NDArray[np.int64],
    traces: NDArray[np.int64],
    states: Floats,
    lamp: Floats,
    optics: Optics,
) -> Optics:
    """Gauss-Newton for spot, darkest, middle and contrast (their logarithms), with pixels far off weighed down."""
    curve, grain = optics.curve, optics.grain

    def model(unknowns: Floats) -> tuple[Floats, Floats]:
        spot, darkest, middle, contrast = np.exp(unknowns)
        exposure, seen = exposures(darkness, rows, traces, states, lamp, spot, optics.spot, optics.shear)
        return ToneCurve(darkest, middle, contrast).darkness(exposure), seen

    unknowns = np.log([optics.spot, curve.darkest, curve.middle, curve.contrast])
    for _ in range(ROUNDS):
        dark, seen = model(unknowns)
        residual = seen - dark
        weight = 1.0 / (grain[0] + grain[1] * dark)
        size = np.abs(residual) * np.sqrt(weight)
        weight = weight * np.where(size > HUBER, HUBER / np.maximum(size, 1e-9), 1.0)
        jacobian = np.stack([(model(unknowns + each)[0] - dark) / 1e-4 for each in 1e-4 * np.eye(4)], axis=1)
        normal = jacobian.T @ (weight[:, None] * jacobian) + 1e-3 * np.eye(4)
        step = np.linalg.solve(normal, jacobian.T @ (weight * residual))
        unknowns = unknowns + np.clip(step, -0.3, 0.3)
        grain = _grain(residual, dark, optics.grain)
        if np.max(np.abs(step)) < 1e-3:
            break
    spot, darkest, middle, contrast = (float(each) for each in np.exp(unknowns))
    return optics.with_(spot=spot, curve=ToneCurve(darkest, middle, contrast), grain=grain)


def _grain(residual: Floats, dark: Floats, before: Floats) -> Floats:
    """Variance of a pixel on blank film, and its growth with darkness, from what the fit leaves."""
    edges = np.quantile(dark, np.linspace(0.0, 1.0, 13))
    place = np.clip(np.searchsorted(edges, dark, side="right") - 1, 0, 11)
    spread = np.array([1.4826 * np.median(np.abs(residual[place == i])) for i in range(12) if np.any(place == i)])
    middle = np.array([dark[place == i].mean() for i in range(12) if np.any(place == i)])
    blank = float(before[0])
    growth = float(np.sum((spread**2 - blank) * middle) / max(float(np.sum(middle**2)), 1e-12))
    return np.array([blank, float(np.clip(growth, LEAST_GROWTH, max(STEEPEST_GRAIN * blank, LEAST_GROWTH)))])


def open_rows(section: Section, spot: float) -> int:
    """How many rows of a section can tell of spot and curve."""
    return int(_chosen_rows(section, spot)[0].size)


def _chosen_rows(section: Section, spot: float) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, float]:
    """Rows and traces to look at, away from gaps: with the lamp's brightness there for all traces, and its median."""
    traces = section.place.shape[0]
    half = max(4, round(0.25 * section.period))
    lamp = np.stack([_running_median(light, half) for light in section.brightness])
    doubtful = ~np.isfinite(section.place) | (section.brightness < LACKING * lamp)
    near = np.stack([np.convolve(each, np.ones(2 * NEAR_GAP + 1), mode="same") > 0.5 for each in doubtful])
    slope = np.abs(section.states[:, :, 1] - section.states[:, :, 5] * section.states[:, :, 4]).T
    place = section.states[:, :, [0, 3]].sum(axis=2).T
    reach = spot * (6.0 + 5.0 * slope)
    rows, owners = [], []
    for k in range(traces):
        open_ = ~near[k]
        for other in range(traces):
            if other != k:
                open_ &= ~near[other] | (np.abs(place[k] - place[other]) > reach[k] + reach[other])
        chosen = np.flatnonzero(open_)
        if chosen.size > MOST_ROWS:
            chosen = chosen[np.linspace(0, chosen.size - 1, MOST_ROWS).astype(int)]
        rows.append(chosen)
        owners.append(np.full(chosen.size, k))
    at = np.concatenate(rows)
    light = np.where(np.isfinite(section.states[at, :, 0]), lamp[:, at].T, 0.0)
    typical = max(_median(light[np.arange(at.size), np.concatenate(owners)]), 1e-6)
    return at, np.concatenate(owners), light / typical, typical


def _running_median(light: Floats, half: int) -> Floats:
    """Median of what is known within `half` rows."""
    wide = np.lib.stride_tricks.sliding_window_view(np.pad(light, half, constant_values=np.nan), 2 * half + 1)
    ordered = np.sort(wide, axis=1)  # NaN last
    count = np.isfinite(ordered).sum(axis=1)
    return np.where(count > 0, ordered[np.arange(light.size), np.maximum(count - 1, 0) // 2], 1.0)


def _median(values: Floats) -> float:
    kept = values[np.isfinite(values)]
    return float(np.median(kept)) if kept.size else 1.0


def measure_shear(section: Section) -> float:
    """Rows by which the image lags per column, from the readings' second harmonic; 0 where it cannot be told.

    With the slit askew by k rows a column, x(r) = A cos(w (r - k x)) = A cos(wr) + k w A^2/2 sin(2 wr) + ...
    """
    values, weights = [], []
    for k in range(section.place.shape[0]):
        state = section.states[:, k]
        read = np.isfinite(section.place[k]) & np.isfinite(state[:, 0])
        frequency = float(np.median(state[read, 5])) if read.any() else 0.0
        rows = np.arange(read.size)[read]
        if frequency <= 0.0 or rows.size < SHEAR_SWINGS * 2.0 * np.pi / frequency:
            continue
        angle = np.arctan2(state[read, 4], state[read, 3])
        amplitude = float(np.median(np.hypot(state[read, 3], state[read, 4])))
        slope = state[read, 1] - state[read, 5] * state[read, 4]
        t = (rows - rows.mean()) / (0.5 * rows.size)
        slow = np.polynomial.polynomial.polyvander(t, max(3, int(rows.size * frequency / np.pi)))
        fast = [f(n * angle) * g for n in (1, 2) for f in (np.cos, np.sin) for g in (np.ones_like(t), t)][:6]
        columns = np.column_stack([np.sin(2 * angle), np.cos(2 * angle), slow, *fast[:4]])
        weight = 1.0 / np.sqrt(1.0 + slope**2)
        weighted = columns * weight[:, None]
        normal = weighted.T @ weighted + 1e-9 * np.eye(columns.shape[1])
        answer = np.linalg.solve(normal, weighted.T @ ((section.place[k][read] - state[read, 0]) * weight))
        values.append(2.0 * answer[0] / (frequency * amplitude**2))
        weights.append((frequency * amplitude**2) ** 2 * rows.size)
    return float(np.average(values, weights=weights)) if values else 0.0
