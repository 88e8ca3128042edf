"""The paper's motion, row against time, from all marks: smooth speed and the lines of wow that the film itself shows.

A Gaussian process: random walks of the acceleration, for what turns smoothly, and of the speed, for what slips and
catches, and damped rotating pairs at the frequencies that stand out. Strengths and the floor of the marks' errors,
which all traces share as one shutter closes them, are the most likely ones; what each trace has beside it, its distance
from the others shows. With the first walk alone the times of a rough drive are worse than they say.
"""

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats
from synth.kernels.compiled import making_kernel

MOST_LINES = 3
STANDS_OUT = 25.0  # power of a line over that of its surroundings
SLOWEST, FASTEST = 60.0, 2.2  # s, periods of wow looked for
CALM = -10.0  # roughness that follows nothing faster than `SLOWEST`
LOWEST, HIGHEST = (-12.0, -8.0, np.log(2e-3)), (8.0, 4.0, np.log(3.0))  # of roughness, shake and the floor's logarithm
START, SIDES = (np.log(0.3), np.log(0.03), np.log(0.03)), np.diag([1.5, 1.0, 0.5])
COHERENCE = (1e6, 3e3)  # s, over which a line of wow may keep its phase
OUTLIER = 5.0  # sigmas
ENOUGH_PAIRS = 12  # marks on two traces
GAINED = 10.0  # fall of -2 log likelihood that a line must bring
LONG_GAP = 3.0  # s without marks
SLIP, LEAST_SLIP, ABOUT = 8.0, 1.5, 11  # deviations, and px, of the rows between two marks; marks about them

Lines = tuple[tuple[float, float, float], ...]
NO_JUMPS = np.zeros(0, dtype=np.int64)


class Model(NamedTuple):
    """Parameters of the paper's motion."""

    step: float  # s between the marks
    roughness: float  # log of 1 sigma of the white noise of the acceleration's rate, px s-5/2
    shake: float  # log of 1 sigma of the white noise of the acceleration itself, px s-3/2
    floor: float  # error that a mark has on all traces, px
    own: float = 0.0  # error that it has on each, beside the measured one, px
    lines: Lines = ()  # of wow: circular frequency, rad s-1, amplitude, px, and coherence, s


@dataclass(frozen=True)
class Drive:
    """A model of the paper's motion and what it makes of all marks from the first to the last."""

    model: Model
    row: Floats  # (marks,), px
    speed: Floats  # px s-1
    acceleration: Floats  # px s-2
    row_sigma: Floats
    speed_sigma: Floats
    used: NDArray[np.bool_]  # (traces, marks), which of the measured rows were believed
    jumps: NDArray[np.int64]  # marks before which the paper stood still
    likelihood: float  # -2 log likelihood


def drive(
    rows: Floats, sigma: Floats, step: float, before: Drive | None = None, jumps: NDArray[np.int64] = NO_JUMPS
) -> Drive:
    """The most likely motion by rows (traces, marks), NaN = missing, every `step` s; lines of `before` stay."""
    first = Model(step, START[0], START[1], math.exp(START[2])) if before is None else before.model
    first = first._replace(own=own_error(rows, sigma))
    paper = _most_likely(rows, sigma, first, jumps)
    for _ in range(MOST_LINES if before is None else 0):
        line = _line(rows, paper)
        if line is None:
            break
        lines = [(*paper.model.lines, (*line, each)) for each in COHERENCE]
        tried = [_most_likely(rows, sigma, paper.model._replace(lines=each), jumps) for each in lines]
        better = min(tried, key=lambda one: one.likelihood)
        if paper.likelihood - better.likelihood < GAINED:
            break
        paper = better
    for _ in range(3):
        residual = (rows - paper.row) / np.sqrt(
            sigma**2 + paper.model.own**2 + paper.model.floor**2 + paper.row_sigma**2
        )
        believed = np.where(np.abs(residual) > OUTLIER, np.nan, rows)
        if np.array_equal(np.isfinite(believed), paper.used):
            break
        paper = _most_likely(believed, sigma, paper.model, jumps)
    return paper


def own_error(rows: Floats, sigma: Floats) -> float:
    """1 sigma, px, of how a mark's `rows` (traces, marks) lie apart beyond their `sigma`; 0 of a single trace."""
    more = []
    for one, other in itertools.combinations(range(len(rows)), 2):
        away = rows[one] - rows[other]
        both = np.isfinite(away)
        if both.sum() >= ENOUGH_PAIRS:
            spread = 1.4826 * np.median(np.abs(away[both] - np.median(away[both])))
            more.append(spread**2 - np.median(sigma[one, both] ** 2 + sigma[other, both] ** 2))
    return math.sqrt(max(0.5 * float(np.mean(more)), 0.0)) if more else 0.0


def slips(rows: Floats) -> NDArray[np.int64]:
    """Marks before which the paper slipped, of rows (traces, marks): apart unlike others, by no mark's own error."""
    from scipy.ndimage import median_filter

    shown = np.isfinite(rows).sum(axis=0)
    marks = np.flatnonzero(shown)
    if marks.size < 2 * ABOUT:
        return NO_JUMPS
    row, count = np.nansum(rows[:, marks], axis=0) / shown[marks], np.diff(marks)
    off = np.diff(row) - count * median_filter(np.diff(row) / count, ABOUT, mode="nearest")
    least = max(SLIP * 1.4826 * float(np.median(np.abs(off))), LEAST_SLIP)
    before, after = np.append(0.0, off[:-1]), np.append(off[1:], 0.0)
    lasting = np.minimum(np.abs(off + before), np.abs(off + after)) > 0.5 * np.abs(off)
    return np.asarray(marks[1:][(np.abs(off) > least * np.sqrt(count)) & lasting & (count < ABOUT)])


def _most_likely(rows: Floats, sigma: Floats, model: Model, jumps: NDArray[np.int64]) -> Drive:
    """Roughness, shake and floor by maximum likelihood, from those of a model on."""
    from scipy.optimize import minimize

    def run(at: Floats, smooth: bool) -> Drive:
        rough, shake, floor = np.clip(at, LOWEST, HIGHEST).tolist()
        tried = model._replace(roughness=rough, shake=shake, floor=math.exp(floor))
        return run_drive(rows, sigma, tried, jumps, smooth)

    def cost(at: Floats) -> float:
        return run(at, False).likelihood + float(np.sum((at - np.clip(at, LOWEST, HIGHEST)) ** 2))

    start = np.array([model.roughness, model.shake, math.log(model.floor)])
    simplex = start + np.vstack([np.zeros(3), SIDES])
    options: Any = {"initial_simplex": simplex, "xatol": 0.1, "fatol": 0.3}
    return run(minimize(cost, start, method="Nelder-Mead", options=options).x, True)


def run_drive(rows: Floats, sigma: Floats, model: Model, jumps: NDArray[np.int64], smooth: bool = True) -> Drive:
    """Filter, and if asked smooth, with given parameters; NaN = missing."""
    from scipy.linalg import block_diag

    h, marks, used = model.step, rows.shape[1], np.isfinite(rows)
    # the rows that several traces show of one mark count as their mean
    variance = np.where(used, sigma**2 + model.own**2, np.inf)
    together = 1.0 / np.maximum((1.0 / variance).sum(axis=0), 1e-300)
    mean = together * np.where(used, rows / variance, 0.0).sum(axis=0)
    known = np.flatnonzero(used.any(axis=0))
    apart = np.sum(np.log(variance[used])) - np.sum(np.log(together[known]))
    apart += np.sum(np.where(used, rows - mean, 0.0) ** 2 / variance)
    first, last = (float(rows[used[:, at], at].mean()) for at in known[[0, -1]])
    pace = (last - first) / max((known[-1] - known[0]) * h, h)
    stood = np.zeros(marks)
    stood[jumps] = (marks * h * pace) ** 2
    rough, shake = np.exp(2.0 * model.roughness), np.exp(2.0 * model.shake)
    walk = rough * np.array([[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]])
    walk[:2, :2] += shake * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])
    steps, noise = [np.array([[1.0, h, 0.5 * h**2], [0.0, 1.0, h], [0.0, 0.0, 1.0]])], [walk]
    before = [np.diag([(0.5 * pace) ** 2 + 1.0, (0.2 * pace) ** 2, (0.1 * pace) ** 2])]
    paths = [np.eye(3)]  # of row, speed and acceleration, what of the state each is the sum of
    for turn, size, coherence in model.lines:
        decay, cos, sin = np.exp(-h / coherence), np.cos(turn * h), np.sin(turn * h)
        steps.append(decay * np.array([[cos, sin], [-sin, cos]]))
        noise.append(0.5 * size**2 * (1.0 - decay**2) * np.eye(2))
        before.append(size**2 * np.eye(2))
        paths.append(np.array([[1.0, 0.0], [0.0, turn], [-(turn**2), 0.0]]))
    sees, step = np.hstack(paths), block_diag(*steps)
    start = np.zeros(sees.shape[1])
    start[:2] = first - known[0] * h * pace, pace
    begin = start, block_diag(*before)
    mean[~used.any(axis=0)] = np.nan
    likelihood, state, spread, *ahead = filter_drive(
        step, block_diag(*noise), sees[0], begin, mean, together + model.floor**2, stood
    )
    if smooth:
        smooth_drive(step, state, spread, *ahead)
    row_sigma, speed_sigma = np.sqrt(np.maximum(np.einsum("pi,kij,pj->pk", sees[:2], spread, sees[:2]), 0.0))
    row, speed, acceleration = sees @ state.T
    return Drive(model, row, speed, acceleration, row_sigma, speed_sigma, used, jumps, likelihood + float(apart))


def aliased(rows: Floats, paper: Drive) -> tuple[float, float]:
    """1 sigma of wow that marks as far apart as these cannot tell from wow of another period, px and px s-1."""
    turn, size = _line(rows, paper, told=False) or (0.0, 0.0)
    return size / math.sqrt(2.0), size / math.sqrt(2.0) * max(turn, 2.0 * np.pi / paper.model.step - turn)


def _line(rows: Floats, paper: Drive, told: bool = True) -> tuple[float, float] | None:
    """Circular frequency and amplitude of the line that stands out most; `told`: its alias is too fast for wow."""
    marks = rows.shape[1]
    if marks * paper.model.step < 2.0 * SLOWEST / 3.0:
        return None
    calm = paper.model._replace(roughness=CALM, shake=CALM, floor=0.05)
    smooth = run_drive(np.where(paper.used, rows, np.nan), np.full_like(rows, 0.05), calm, paper.jumps)
    shown = paper.used.sum(axis=0)  # of the marks themselves: the most likely motion may take a line for their errors
    remainder = np.where(paper.used, rows - smooth.row, 0.0).sum(axis=0) / np.maximum(shown, 1)
    power = np.abs(np.fft.rfft((remainder - remainder.mean()) * np.hanning(marks), 4 * marks)) ** 2
    turn = 2.0 * np.pi * np.arange(power.size) / (4 * marks * paper.model.step)
    alone = 2.0 * np.pi / paper.model.step - turn > 2.0 * np.pi / FASTEST
    inside = np.flatnonzero((turn > 2.0 * np.pi / SLOWEST) & (turn < 2.0 * np.pi / FASTEST) & (alone == told))
    if inside.size < 16:
        return None
    top = inside[int(np.argmax(power[inside] * turn[inside] ** 2))]
    around = inside[(np.abs(inside - top) > 12) & (np.abs(np.log(turn[inside] / turn[top])) < 0.7)]
    if around.size < 8 or power[top] < STANDS_OUT * np.median(power[around]):
        return None
    a, b, c = np.log(power[top - 1 : top + 2])
    place = top + 0.5 * (a - c) / (a - 2.0 * b + c)
    size = 2.0 * np.sqrt(power[top]) / np.hanning(marks).sum()
    return float(2.0 * np.pi * place / (4 * marks * paper.model.step)), float(size)


def honest_gaps(rows: Floats, sigma: Floats, paper: Drive) -> Drive:
    """The same, its 1 sigma in long gaps as large as errors are where marks are hidden over as long a time."""
    seen = np.flatnonzero(paper.used.any(axis=0))
    length = int(np.diff(seen).max(initial=0))
    if length * paper.model.step < LONG_GAP or seen.size < 6 * length:
        return paper
    number = np.arange(rows.shape[1])
    hidden = (number % (3 * length) >= length) & (number % (3 * length) < 2 * length) & (number < number.size - length)
    blind = run_drive(np.where(paper.used & ~hidden, rows, np.nan), sigma, paper.model, paper.jumps)
    gaps = hidden & (paper.row_sigma < 0.5 * blind.row_sigma)
    away = (blind.row - paper.row)[gaps] / blind.row_sigma[gaps]
    if away.size < 3:
        return paper
    scale, inside = max(1.0, float(np.sqrt(np.mean(away**2)))), np.zeros(number.size, dtype=bool)
    for begin, stop in itertools.pairwise(seen.tolist()):
        inside[begin + 1 : stop] = (stop - begin) * paper.model.step >= LONG_GAP
    return replace(paper, row_sigma=np.where(inside, scale * paper.row_sigma, paper.row_sigma))


@making_kernel
def filter_drive(
    step: Floats, noise: Floats, sees: Floats, begin: tuple[Floats, Floats],
    rows: Floats, variance: Floats, stood: Floats,
) -> tuple[float, Floats, Floats, Floats, Floats]:  # fmt: skip
    """Kalman filter over marks: -2 log likelihood, and state (marks, n) and covariance after each mark, and before.

    The state goes on by `step` (n, n) with the covariance `noise`, and `sees` (n,) makes a row of it, with its
    `variance`; NaN = missing. `stood` is the row's variance from the paper's having stood before a mark.
    """
    marks, n = rows.size, sees.size
    state, ahead = np.empty((marks, n)), np.empty((marks, n))
    spread, ahead_spread = np.empty((marks, n, n)), np.empty((marks, n, n))
    x, p = begin
    back, likelihood = np.ascontiguousarray(step.T), 0.0
    for k in range(marks):
        if k > 0:
            x, p = step @ x, step @ p @ back + noise
            p[0, 0] += stood[k]
        ahead[k], ahead_spread[k] = x, p
        if not math.isnan(rows[k]):
            gain = p @ sees
            away, total = rows[k] - sees @ x, variance[k] + sees @ gain
            x, p = x + gain * (away / total), p - np.outer(gain, gain / total)
            likelihood += away * away / total + math.log(total)
        state[k], spread[k] = x, p
    return likelihood, state, spread, ahead, ahead_spread


@making_kernel
def smooth_drive(step: Floats, state: Floats, spread: Floats, ahead: Floats, ahead_spread: Floats) -> None:
    """Rauch, Tung and Striebel's smoother: `state` and `spread` become those given all marks."""
    for k in range(state.shape[0] - 2, -1, -1):
        gain = np.ascontiguousarray(np.linalg.solve(ahead_spread[k + 1], step @ spread[k]).T)
        state[k] += gain @ (state[k + 1] - ahead[k + 1])
        change = gain @ (spread[k + 1] - ahead_spread[k + 1]) @ gain.T
        spread[k] += 0.5 * (change + change.T)
