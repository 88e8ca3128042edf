"""The sea's and the vibration's spectrum from a trace: where the search for their likelihood begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.problem import Problem
from pipeline.joint.ship import Component, Sea, Vibration, density

WINDOW = 100.0  # s
LEAST_WINDOWS = 3
BINS = 160
LINE = 0.06  # half width about the swing's frequency and its harmonics, relative, that the swing itself fills
FILLED = 1.5  # s: longest gap that is interpolated for the spectrum's sake


def periodogram(problem: Problem, trace: int) -> tuple[Floats, Floats, Floats]:
    """Mean periodogram of a trace without its own swing.

    Returns
    -------
    frequency, power, weight : (f,) arrays
        rad s-1; two-sided density, rad2 s; number of periodogram ordinates in each bin. Empty where the trace has no
        stretch of three windows.
    """
    lattice = problem.lattice
    used = lattice.trace == trace
    if problem.left_out.size:
        used &= ~problem.left_out
    time, value = lattice.time[used], lattice.value[used]
    if time.size < 64:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    step = max(float(np.median(np.diff(time))), 1e-3)
    length = min(WINDOW, float(time[-1] - time[0]) / LEAST_WINDOWS)
    rows = int(length / step)
    swing = float(np.sqrt(problem.kappa.mean()))
    taper = np.hanning(rows + 2)[1:-1] ** 2
    own = np.arange(rows) * step
    own -= own.mean()
    columns = [np.ones(rows), own]
    for multiple in (1.0, 3.0):
        if multiple * swing * step < np.pi:
            turn = np.cos(multiple * swing * own), np.sin(multiple * swing * own)
            columns += [*turn, own * turn[0], own * turn[1]] if multiple == 1.0 else turn
    design = np.stack(columns, axis=1)
    left = taper[:, None] * design
    inverse = np.linalg.solve(design.T @ left, left.T)
    total, count = np.zeros(rows // 2 + 1), 0
    for begin in np.arange(time[0], time[-1] - length, 0.5 * length):
        grid = begin + step * np.arange(rows)
        low, high = np.searchsorted(time, (grid[0] - FILLED, grid[-1] + FILLED))
        here, there = time[low:high], value[low:high]
        if here.size < 8 or here[0] > grid[0] + step or here[-1] < grid[-1] - step:
            continue
        if np.diff(here).max() > max(FILLED, 1.5 * step):
            continue
        series = (
            there if here.size == rows and np.abs(here - grid).max() < 1e-6 * step else np.interp(grid, here, there)
        )
        series = series - design @ (inverse @ series)
        total += np.abs(np.fft.rfft(taper * series)) ** 2
        count += 1
    if count == 0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    frequency = 2.0 * np.pi * np.fft.rfftfreq(rows, step)
    power = total * step / (count * float(taper @ taper))
    keep = np.ones(frequency.size, dtype=bool)
    keep[:2] = False
    for multiple in (1.0, 3.0):
        keep &= np.abs(frequency / (multiple * swing) - 1.0) > LINE / multiple
    keep &= frequency < 0.95 * np.pi / step
    return _binned(frequency[keep], power[keep], 0.5 * count)


def _binned(frequency: Floats, power: Floats, each: float) -> tuple[Floats, Floats, Floats]:
    edges = np.geomspace(frequency[0], frequency[-1] * 1.0001, BINS + 1)
    at = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, BINS - 1)
    count = np.bincount(at, minlength=BINS)
    some = count > 0
    return (
        np.bincount(at, frequency, BINS)[some] / count[some],
        np.bincount(at, power, BINS)[some] / count[some],
        each * count[some],
    )


def noise_floor(problem: Problem, trace: int) -> float:
    """White reading noise of a trace from the quietest part of its spectrum, rad."""
    frequency, power, weight = periodogram(problem, trace)
    if not frequency.size:
        return float("nan")
    order = np.argsort(power)
    part = order[: max(4, order.size // 4)]
    used = problem.lattice.trace == trace
    step = max(float(np.median(np.diff(problem.lattice.time[used]))), 1e-3)
    return float(np.sqrt(np.average(power[part], weights=weight[part]) / step))


def transfer(problem: Problem, trace: int, frequency: Floats) -> Floats:
    """Square of a trace's answer to U, by frequency."""
    answer = np.zeros(frequency.size)
    for i in range(problem.pendulums):
        kappa = float(problem.kappa[i])
        answer = answer - problem.lattice.combination[trace, i] * kappa / (kappa - frequency**2)
    return np.asarray(answer**2)


def begin(problem: Problem, trace: int, noise: float) -> tuple[Component, ...]:
    """Swell and vibration that a trace's spectrum asks for, by Whittle's likelihood."""
    from scipy.optimize import minimize

    frequency, power, weight = periodogram(problem, trace)
    if not frequency.size:
        return (Sea(0.7, 0.12, 1e-2), Vibration(6.0, 1e-3))
    answer = transfer(problem, trace, frequency)
    used = problem.lattice.trace == trace
    step = max(float(np.median(np.diff(problem.lattice.time[used]))), 1e-3)
    white = noise**2 * step
    motion = np.maximum(power - white, 1e-6 * power) / answer
    swing = float(np.sqrt(problem.kappa.mean()))
    sea = frequency < 0.8 * swing
    peak = float(frequency[sea][np.argmax((motion * frequency)[sea])])
    size = float(np.sqrt(np.trapezoid(motion[sea], frequency[sea]) / np.pi))
    fast = motion[frequency > 0.6 * swing]
    rate = 6.0
    level = float(np.sqrt(max(np.median(fast), 1e-30) * rate * 3.0 / 16.0)) if fast.size else 0.1 * size
    first = (Sea(peak, 0.15 * peak, max(size, 1e-9)), Vibration(rate, max(level, 1e-9)))
    start = parameters(first)

    def cost(vector: Floats) -> float:
        vector = np.clip(vector, start - 2.0 * REACH, start + 2.0 * REACH)
        model = answer * density(assemble(first, vector), frequency, "horizontal") + white
        outside = np.sum(np.maximum(0.0, np.abs(vector - start) - REACH) ** 2)
        return float(np.sum(weight * (np.log(model) + power / model))) + 1e3 * float(outside)

    simplex = np.vstack([start, *(start + 0.5 * row for row in np.eye(start.size))])
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": 400, "xatol": 0.02, "fatol": 0.1},
    )
    return assemble(first, found.x)


REACH = np.array([0.9, 1.6, 5.0, 2.0, 7.0])
"""How far the logarithms may go from where they began."""


def parameters(components: tuple[Component, ...]) -> Floats:
    """Logarithms of frequency or rate, relative damping and size of all components."""
    out: list[float] = []
    for each in components:
        if isinstance(each, Vibration):
            out += [each.rate, each.rms]
        else:
            out += [each.frequency, each.damping / each.frequency, each.rms]
    return np.log(out)


def spreads(components: tuple[Component, ...]) -> Floats:
    """1 sigma of the logarithms of `parameters` about what a spectrum gives."""
    out: list[float] = []
    for each in components:
        out += [1.0, 1.5] if isinstance(each, Vibration) else [0.2, 0.7, 1.0]
    return np.array(out)


def assemble(like: tuple[Component, ...], vector: Floats) -> tuple[Component, ...]:
    """Components of the same kinds with other numbers."""
    values = iter(np.exp(vector).tolist())
    out: list[Component] = []
    for each in like:
        if isinstance(each, Vibration):
            out.append(replace(each, rate=next(values), rms=next(values)))
        else:
            frequency = next(values)
            out.append(replace(each, frequency=frequency, damping=frequency * next(values), rms=next(values)))
    return tuple(out)
