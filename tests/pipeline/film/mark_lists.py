"""Lists of gaps as a search would find them on a film, made without an image: times through a paper drive to rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.film.marks.alignment import Bars, Gaps
from pipeline.film.marks.search import GapSearch
from pipeline.film.parts import Floats, Tracks


@dataclass(frozen=True)
class Case:
    """A film's defects; lengths in px, times in s, the rest relative."""

    seed: int = 0
    minutes: float = 30.0
    speed: float = 59.06  # rows per second: 5 mm/s at 300 dpi
    missing: float = 0.0
    spurious: int = 0
    wow: float = 0.0
    wow_period: float = 7.0
    drift: float = 0.0
    walk: float = 0.0
    shear: float = 0.0
    offset: float = 0.0
    hidden: tuple[tuple[float, float], ...] = ()
    blackout: tuple[tuple[float, float], ...] = ()
    stands: tuple[tuple[float, float], ...] = ()
    """When, and for how long, the paper stood still."""
    changes: tuple[tuple[float, float, float], ...] = ()
    """From when to when the paper ran at another speed, and how many times as fast."""
    code: float | None = 0.125
    code_missing: float = 0.0
    start: float = 3.2
    unseen: float = 0.01  # gaps of single traces not found
    dust: int = 0  # false gaps on single traces
    backwards: bool = False
    traces: int = 2
    swell: float = 0.2  # phase of the first pendulum disturbed, rad


@dataclass(frozen=True)
class Made:
    """Gaps, the traces they lie on, and the truth: numbers and rows (column 0, first trace) of all marks."""

    gaps: Gaps
    tracks: Tracks
    number: Floats
    row: Floats
    seconds: Floats
    width: float

    def search(self, bars: Bars | None = None) -> GapSearch:
        """What a search of the film would have found."""
        return GapSearch(self.gaps, bars or [], self.width)


def made(case: Case) -> Made:
    """Gaps and traces of a film."""
    rng = np.random.default_rng(case.seed)
    length, step = 60.0 * case.minutes, 0.02
    time = case.start + np.arange(0.0, length + 2.0, step)
    passed = time - case.start
    rate = (
        1.0 + case.drift * passed / length + case.wow * np.sin(2 * np.pi * passed / case.wow_period + rng.uniform(0, 6))
    )
    if case.walk:
        knots = np.convolve(
            rng.normal(size=int(length) + 20), np.hanning(9) / np.sqrt((np.hanning(9) ** 2).sum()), "same"
        )
        rate += case.walk * np.interp(passed, np.arange(knots.size) - 5.0, knots)
    for begin, stop, factor in case.changes:
        rate[(passed >= begin) & (passed < stop)] *= factor
    for begin, stood in case.stands:
        rate[(passed >= begin) & (passed < begin + stood)] = 1e-6
    row = 30.0 + case.speed * (np.cumsum(rate) - rate) * step
    end = passed <= length
    rows = int(row[end][-1]) + 30
    number = np.arange(np.ceil((case.start + 0.2) / 0.5), np.floor((case.start + length - 0.2) / 0.5) + 1)
    keep = rng.random(number.size) >= case.missing
    for begin, stop in case.hidden:
        keep &= ~((number * 0.5 - case.start >= begin) & (number * 0.5 - case.start < stop))
    closed = number[keep] * 0.5
    if case.code:
        minutes = closed[np.abs(np.mod(closed + 1.0, 60.0) - 1.0) < 1e-6]
        closed = np.concatenate([closed, minutes[rng.random(minutes.size) >= case.code_missing] + case.code])
    false = rng.uniform(case.start + 1.0, case.start + length - 1.0, case.spurious)
    closed = np.sort(np.concatenate([closed, false]))
    dark = (*case.blackout, *((begin, begin + stood) for begin, stood in case.stands))
    for begin, stop in dark:
        closed = closed[~((closed - case.start > begin) & (closed - case.start < stop))]
    periods, middles, sizes = (1.00966, 1.009760966, 1.00971), (531.0, 1004.0, 760.0), (118.0, 94.0, 60.0)
    course, slope, trace, found = [], [], [], []
    centre = np.arange(rows) + 0.5
    for k in range(case.traces):
        disturbed = case.swell * (k == 0) * np.sin(2 * np.pi * time / 21.0)
        swing = middles[k] + sizes[k] * np.cos(2 * np.pi * time / periods[k] + 0.4 + 1.7 * k + disturbed)
        swing += (k == 0) * 20.0 * np.sin(2 * np.pi * time / 9.0)
        at = row + k * case.offset + case.shear * swing
        curve = np.interp(centre, at, swing)
        lean = np.gradient(swing) / np.gradient(at)
        for begin, stop in case.blackout:
            dark = (centre > np.interp(begin, passed, at)) & (centre < np.interp(stop, passed, at))
            curve[dark] = np.nan
        course.append(curve)
        slope.append(np.gradient(curve))
        seen = closed[rng.random(closed.size) >= case.unseen]
        seen = np.concatenate([seen, rng.uniform(case.start + 1.0, case.start + length - 1.0, case.dust)])
        trace.append(np.full(seen.size, k))
        found.append(np.stack([np.interp(seen, time, each) for each in (at, swing, lean)]))
    which, values = np.concatenate(trace), np.concatenate(found, axis=1)
    sigma = 0.02 + 0.02 * rng.random(which.size)
    values[0] += sigma * rng.normal(size=sigma.size)
    if case.backwards:
        values[0], values[2] = rows - values[0], -values[2]
        course, slope = [each[::-1] for each in course], [-each[::-1] for each in slope]
    order = np.argsort(values[0], kind="stable")
    which, values, sigma = which[order], values[:, order], sigma[order]
    one = np.ones(which.size)
    width = 0.03 * case.speed
    gaps = Gaps(
        which.astype(np.int64), values[0], sigma, values[1], 0.1 * one, values[2],
        width * (1 + 0.02 * rng.normal(size=one.size)), 0.02 * width * one, one, 0.02 * one, one, one,
    )  # fmt: skip
    shape = np.zeros((case.traces, rows))
    tracks = Tracks(
        position=np.array(course), sigma=shape + 0.2, course=np.array(course), slope=np.array(slope), curvature=shape,
        brightness=shape + 1.0, qc=shape.astype(np.uint16), rows_per_swing=1.0097 * case.speed, spot=1.2,
    )  # fmt: skip
    true_row = np.interp(number * 0.5, time, row)
    seconds = np.interp(centre, row, time)
    return Made(gaps, tracks, number, true_row, seconds, width)


def slips(axis_index: Floats, axis_row: Floats, truth: Made) -> Floats:
    """By how much each mark's number is wrong, modulo a minute of marks (-60 to 60)."""
    true = truth.number[np.argmin(np.abs(axis_row[:, None] - truth.row[None, :]), axis=1)]
    return np.mod(axis_index - true + 60.0, 120.0) - 60.0
