"""The paper's motion, row against time, from all marks: smooth speed and the lines of wow that the film itself shows.

A Gaussian process: a random walk of the acceleration for what turns smoothly, one of the speed for what slips and
catches, and damped rotating pairs at the frequencies that stand out of what is left. Their strengths and the floor of
the marks' errors are the most likely ones. With the first walk alone a rough drive is smoothed too much, and the times
are worse than they say.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats
from synth.kernels.compiled import kernel

MOST_LINES = 3
STANDS_OUT = 25.0  # power of a line over that of its surroundings
SLOWEST, FASTEST = 60.0, 2.2  # s, periods of wow looked for
CALM = -10.0  # roughness that follows nothing faster than `SLOWEST`
LOWEST, HIGHEST = (-12.0, -8.0, np.log(2e-3)), (8.0, 4.0, np.log(3.0))  # of roughness, shake and the floor's logarithm
START, SIDES = (np.log(0.3), np.log(0.03), np.log(0.03)), ((1.5, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.5))
COHERENCE = (1e6, 3e3)  # s, over which a line of wow may keep its phase
OUTLIER = 5.0  # sigmas
GAINED = 10.0  # fall of -2 log likelihood that a line must bring

Lines = tuple[tuple[float, float, float], ...]
HOLE = 3.0  # s without marks
NO_JUMPS = np.zeros(0, dtype=np.int64)


class Motion(NamedTuple):
    """The paper's motion from mark to mark, for the filter: n numbers make its state.

    Attributes
    ----------
    step, noise : (n, n) arrays
        From one mark to the next.
    seen : (n,) array
        What of the state a row is the sum of.
    start, variance : (n,), (n, n) arrays
        Before the first mark is seen.
    """

    step: Floats
    noise: Floats
    seen: Floats
    start: Floats
    variance: Floats


@dataclass(frozen=True)
class Drive:
    """A model of the paper's motion and what it makes of the marks.

    Attributes
    ----------
    step : float
        s between the marks.
    roughness : float
        Standard deviation of the white noise of the acceleration's rate, px s-5/2, as its natural logarithm.
    shake : float
        That of the white noise of the acceleration itself, px s-3/2, as its natural logarithm.
    floor : float
        Error that all marks have beside the measured one, px.
    lines : tuple of (float, float, float)
        Circular frequency, rad s-1, amplitude, px, and coherence, s, of lines of wow.
    row, speed, acceleration : (marks,) arrays
        At every mark from the first to the last, px, px s-1, px s-2.
    row_sigma, speed_sigma : (marks,) arrays
        1 sigma of row and speed, px, px s-1.
    used : (traces, marks) array of bool
        Which of the measured rows were believed.
    jumps : (n,) array of int64
        Marks before which the paper stood still.
    likelihood : float
        -2 log likelihood.
    """

    step: float
    roughness: float
    shake: float
    floor: float
    lines: Lines
    row: Floats
    speed: Floats
    acceleration: Floats
    row_sigma: Floats
    speed_sigma: Floats
    used: NDArray[np.bool_]
    jumps: NDArray[np.int64]
    likelihood: float


def drive(
    rows: Floats, sigma: Floats, step: float, before: Drive | None = None, jumps: NDArray[np.int64] = NO_JUMPS
) -> Drive:
    """The most likely motion.

    Parameters
    ----------
    rows, sigma : (traces, marks) arrays
        Measured, freed of offsets and shear, and 1 sigma; NaN = missing; marks follow each other every `step` s.
    before : Drive, optional
        Found of nearly the same rows: its lines stay.
    jumps : (n,) array of int64
        Marks before which the paper stood still.
    """
    used = np.isfinite(rows)
    if before is None:
        found = _most_likely(rows, sigma, step, (), used, jumps)
    else:
        found = _most_likely(rows, sigma, step, before.lines, used, jumps, _parameters(before))
    for _ in range(MOST_LINES if before is None else 0):
        line = _line(np.where(used, rows, np.nan), found)
        if line is None:
            break
        guess = _parameters(found)
        tried = [
            _most_likely(rows, sigma, step, (*found.lines, (*line, each)), used, jumps, guess) for each in COHERENCE
        ]
        better = min(tried, key=lambda one: one.likelihood)
        if found.likelihood - better.likelihood < GAINED:
            break
        found = better
    for _ in range(3):
        left = (rows - found.row) / np.sqrt(sigma**2 + found.floor**2 + found.row_sigma**2)
        good = np.isfinite(rows) & ~(np.abs(left) > OUTLIER)
        if np.array_equal(good, used):
            break
        used = good
        found = _most_likely(rows, sigma, step, found.lines, used, jumps, _parameters(found))
    return found


def _parameters(found: Drive) -> tuple[float, float, float]:
    """Roughness, shake, and logarithm of the floor."""
    return found.roughness, found.shake, float(np.log(found.floor))


def _most_likely(
    rows: Floats,
    sigma: Floats,
    step: float,
    lines: Lines,
    used: NDArray[np.bool_],
    jumps: NDArray[np.int64],
    guess: tuple[float, float, float] = START,
) -> Drive:
    from scipy.optimize import minimize

    seen, start = np.where(used, rows, np.nan), np.array(guess)

    def run(at: Floats, smooth: bool) -> Drive:
        rough, shake, floor = np.clip(at, LOWEST, HIGHEST)
        return run_drive(
            seen, sigma, step, float(rough), float(shake), float(np.exp(floor)), lines, used, jumps, smooth
        )

    def price(at: Floats) -> float:
        return run(at, False).likelihood + float(np.sum((at - np.clip(at, LOWEST, HIGHEST)) ** 2))

    first = start + np.array([(0.0, 0.0, 0.0), *SIDES])
    best = minimize(price, start, method="Nelder-Mead", options={"initial_simplex": first, "xatol": 0.1, "fatol": 0.3})
    return run(best.x, True)


def run_drive(
    seen: Floats,
    sigma: Floats,
    step: float,
    rough: float,
    shake: float,
    floor: float,
    lines: Lines,
    used: NDArray[np.bool_],
    jumps: NDArray[np.int64],
    smooth: bool,
) -> Drive:
    """Filter, and if asked smooth, with given parameters."""
    n = 3 + 2 * len(lines)
    move, noise, sees = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    move[:3, :3] = [[1.0, step, 0.5 * step**2], [0.0, 1.0, step], [0.0, 0.0, 1.0]]
    noise[:3, :3] = np.exp(2.0 * rough) * np.array(
        [
            [step**5 / 20, step**4 / 8, step**3 / 6],
            [step**4 / 8, step**3 / 3, step**2 / 2],
            [step**3 / 6, step**2 / 2, step],
        ]
    )
    noise[:2, :2] += np.exp(2.0 * shake) * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
    sees[0] = 1.0
    middle = np.nanmean(np.where(np.isfinite(seen).any(axis=0), seen, 0.0), axis=0)
    known = np.flatnonzero(np.isfinite(seen).any(axis=0))
    pace = (middle[known[-1]] - middle[known[0]]) / max((known[-1] - known[0]) * step, step)
    start = np.zeros(n)
    start[:2] = middle[known[0]] - known[0] * step * pace, pace
    before = np.zeros((n, n))
    before[0, 0], before[1, 1], before[2, 2] = (0.5 * pace) ** 2 + 1.0, (0.2 * pace) ** 2, (0.1 * pace) ** 2
    for k, (turn, size, coherence) in enumerate(lines):
        at = slice(3 + 2 * k, 5 + 2 * k)
        decay = np.exp(-step / coherence)
        cos, sin = np.cos(turn * step), np.sin(turn * step)
        move[at, at] = decay * np.array([[cos, sin], [-sin, cos]])
        noise[at, at] = 0.5 * size**2 * (1.0 - decay**2) * np.eye(2)
        before[at, at] = size**2 * np.eye(2)
        sees[3 + 2 * k] = 1.0
    stood = np.zeros(seen.shape[1])
    stood[jumps] = (seen.shape[1] * step * pace) ** 2
    motion = Motion(move, noise, sees, start, before)
    likelihood, state, spread, ahead, ahead_spread = filter_drive(motion, seen, sigma**2 + floor**2, stood)
    if smooth:
        smooth_drive(move, state, spread, ahead, ahead_spread)
    runs, acceleration = np.eye(n)[1], state[:, 2].copy()
    for k, (turn, _, _) in enumerate(lines):
        runs[4 + 2 * k] = turn
        acceleration -= turn**2 * state[:, 3 + 2 * k]
    row_variance, speed_variance = (np.einsum("i,kij,j->k", each, spread, each) for each in (sees, runs))
    return Drive(
        step,
        rough,
        shake,
        floor,
        lines,
        state @ sees,
        state @ runs,
        acceleration,
        np.sqrt(np.maximum(row_variance, 0.0)),
        np.sqrt(np.maximum(speed_variance, 0.0)),
        used,
        jumps,
        likelihood,
    )


def _line(rows: Floats, found: Drive) -> tuple[float, float] | None:
    """The line that stands out most of what smooth motion leaves: circular frequency and amplitude, or None."""
    marks = rows.shape[1]
    if marks * found.step < 2.0 * SLOWEST / 3.0:
        return None
    still = run_drive(
        rows, np.full_like(rows, 0.05), found.step, CALM, CALM, 0.05, found.lines, found.used, found.jumps, True
    )
    left = found.row - still.row
    left = left - left.mean()
    power = np.abs(np.fft.rfft(left * np.hanning(marks), 4 * marks)) ** 2
    turn = 2.0 * np.pi * np.arange(power.size) / (4 * marks * found.step)
    inside = np.flatnonzero((turn > 2.0 * np.pi / SLOWEST) & (turn < 2.0 * np.pi / FASTEST))
    if inside.size < 16:
        return None
    top = inside[int(np.argmax(power[inside] * turn[inside] ** 2))]
    around = inside[(np.abs(inside - top) > 12) & (np.abs(np.log(turn[inside] / turn[top])) < 0.7)]
    if around.size < 8 or power[top] < STANDS_OUT * np.median(power[around]):
        return None
    a, b, c = np.log(power[top - 1 : top + 2])
    place = top + 0.5 * (a - c) / (a - 2.0 * b + c)
    size = 2.0 * np.sqrt(power[top]) / np.hanning(marks).sum()
    return float(2.0 * np.pi * place / (4 * marks * found.step)), float(size)


def holes_honest(rows: Floats, sigma: Floats, found: Drive) -> Drive:
    """The same, with its 1 sigma in long holes as large as errors are where marks are hidden over as long a time.

    The model's own sigma in a hole rests on the form of its motion, not on marks.
    """
    seen = np.flatnonzero((np.isfinite(rows) & found.used).any(axis=0))
    length = int(np.diff(seen).max(initial=0))
    if length * found.step < HOLE or seen.size < 6 * length:
        return found
    hidden = np.zeros(rows.shape[1], dtype=bool)
    for begin in range(length, rows.shape[1] - length, 3 * length):
        hidden[begin : begin + length] = True
    left = found.used & ~hidden
    parameters = (found.step, found.roughness, found.shake, found.floor, found.lines)
    blind = run_drive(np.where(left, rows, np.nan), sigma, *parameters, left, found.jumps, True)
    holes = hidden & (found.row_sigma < 0.5 * blind.row_sigma)
    away = (blind.row - found.row)[holes] / blind.row_sigma[holes]
    if away.size < 3:
        return found
    scale = max(1.0, float(np.sqrt(np.mean(away**2))))
    inside = np.zeros(rows.shape[1], dtype=bool)
    for begin, stop in itertools.pairwise(seen.tolist()):
        inside[begin + 1 : stop] = (stop - begin) * found.step >= HOLE
    return replace(found, row_sigma=np.where(inside, scale * found.row_sigma, found.row_sigma))


@kernel
def filter_drive(
    motion: Motion, rows: Floats, variance: Floats, stood: Floats
) -> tuple[float, Floats, Floats, Floats, Floats]:
    """Kalman filter forward over marks measured on any of the traces, (traces, marks); NaN = missing.

    `stood` (marks,) is the row's variance from the paper's having stood before a mark.

    Returns
    -------
    likelihood : float
        -2 log likelihood.
    state, spread, ahead, ahead_spread : (marks, n) and (marks, n, n) arrays
        After each mark is seen, and before.
    """
    step, noise, seen, start, start_variance = motion
    marks, n = rows.shape[1], start.size
    state, ahead = np.empty((marks, n)), np.empty((marks, n))
    spread, ahead_spread = np.empty((marks, n, n)), np.empty((marks, n, n))
    x, p = start.copy(), start_variance.copy()
    gain, moved, half = np.empty(n), np.empty(n), np.empty((n, n))
    total = 0.0
    for k in range(rows.shape[1]):
        if k > 0:
            for i in range(n):
                moved[i] = 0.0
                for j in range(n):
                    moved[i] += step[i, j] * x[j]
                    half[i, j] = 0.0
                    for m in range(n):
                        half[i, j] += step[i, m] * p[m, j]
            for i in range(n):
                x[i] = moved[i]
                for j in range(n):
                    value = noise[i, j]
                    for m in range(n):
                        value += half[i, m] * step[j, m]
                    p[i, j] = value
            p[0, 0] += stood[k]
        ahead[k], ahead_spread[k] = x, p
        for trace in range(rows.shape[0]):
            away = rows[trace, k]
            if math.isnan(away):
                continue
            room = variance[trace, k]
            for i in range(n):
                gain[i] = 0.0
                for j in range(n):
                    gain[i] += p[i, j] * seen[j]
                away -= seen[i] * x[i]
            for i in range(n):
                room += seen[i] * gain[i]
            for i in range(n):
                x[i] += gain[i] * away / room
            for i in range(n):
                for j in range(n):
                    p[i, j] -= gain[i] * gain[j] / room
            total += away * away / room + math.log(room)
        state[k], spread[k] = x, p
    return total, state, spread, ahead, ahead_spread


@kernel
def smooth_drive(step: Floats, state: Floats, spread: Floats, ahead: Floats, ahead_spread: Floats) -> None:
    """Rauch, Tung and Striebel's smoother: `state` and `spread` become those given all marks."""
    for k in range(state.shape[0] - 2, -1, -1):
        gain = np.ascontiguousarray(np.linalg.solve(ahead_spread[k + 1], step @ spread[k]).T)
        state[k] += gain @ (state[k + 1] - ahead[k + 1])
        change = gain @ (spread[k + 1] - ahead_spread[k + 1]) @ gain.T
        spread[k] += 0.5 * (change + change.T)
