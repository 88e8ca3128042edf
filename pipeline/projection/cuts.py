"""Long gaps of the first pendulum: where they are cut out, and what a bridge across each leaves unknown.

How far a bridge errs nobody sees in the gap itself. So bridges of the same length are laid where readings are, and what
they do to the difference is compared with what the readings do: the record's own swell and vibration tell the error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes
from pipeline.gaps import bridge, rounded_up
from pipeline.prepared import Prepared
from pipeline.projection.upsample import FILTER_REACH, upsample

MARGIN = 4  # readings on each side that the quadrature reaches over
SIDE = 12.0  # s of readings that the longest bridge rests on, see `gaps.CANDIDATES`
TRIALS = 32
LEAST_TRIALS = 2.0  # of independent ones; fewer tell nothing
GOLDEN = 0.6180339887498949  # multiples of it fall evenly and in step with no beat
SETTLE = 150.0  # s between trials at marks: as far as the envelope's spline feels a gap


@dataclass(frozen=True)
class Cut:
    """A span of the record that is cut out, s, and 1 sigma of each part of `int exp(-i n t) error dt` in it, rad s."""

    begin: float
    end: float
    spread: float


def cuts(prepared: Prepared, factor: int = 1, margin: int = MARGIN) -> list[Cut]:
    """Spans that the record's long gaps take, in order, and what bridges across them leave unknown.

    Parameters
    ----------
    prepared : Prepared
        A record.
    factor : int
        How many times finer than the readings the first pendulum's grid is, at marks.
    margin : int
        Readings on each side of a gap over which what stands in it is felt.
    """
    step, known = prepared.whole_step, prepared.trials
    reach = max(margin, int(SIDE / step))
    found: list[Cut] = []
    gaps = [(0, 0), *prepared.long_gaps, (prepared.whole.size, 0)]
    for (_, before), (start, stop), (after, _) in zip(gaps, gaps[1:], gaps[2:], strict=False):
        length = rounded_up(stop - start)
        if length not in known:
            known[length] = _trials(prepared, length, factor)
        begin, end = (start - margin) * step, (stop - 1 + margin) * step
        # a bridge with less on either side than those on trial is worth nothing
        bare = min(start - before, after - stop) < reach
        spread = np.inf if bare else known[length]
        if found and begin <= found[-1].end:
            found[-1] = Cut(found[-1].begin, end, float(np.hypot(found[-1].spread, spread)))
        else:
            found.append(Cut(begin, end, spread))
    return found


def _trials(prepared: Prepared, length: int, factor: int) -> float:
    """1 sigma of each part of what a bridge over so many readings errs by, rad s."""
    step, size = prepared.whole_step, prepared.whole.size
    side = int(np.ceil(SIDE / step)) if factor == 1 else int(np.ceil(SETTLE / step))
    edges = [0, *(edge for gap in prepared.long_gaps for edge in gap), size]
    lows, highs = np.array(edges[::2]), np.array(edges[1::2])
    rooms = np.maximum(highs - lows - 2 * side - length + 1, 0)  # places in each stretch
    ends = np.cumsum(rooms)
    independent = min(TRIALS, float(ends[-1]) / length)
    if independent < LEAST_TRIALS:
        return float("inf")
    numbers = (ends[-1] * (np.arange(TRIALS) * GOLDEN % 1.0)).astype(np.int64)
    stretch = np.searchsorted(ends, numbers, side="right")
    drawn = ((lows + side + rooms - ends)[stretch] + numbers).tolist()
    errors = _dense(prepared, drawn, length, side) if factor == 1 else _marks(prepared, drawn, length, side, factor)
    independent = min(independent, float(errors.size))
    if independent < LEAST_TRIALS:
        return float("inf")
    # of so few trials a mean square may be so much too small
    return float(np.sqrt(0.5 * independent / (independent - 1.0) * np.mean(np.abs(errors) ** 2)))


def _dense(prepared: Prepared, places: list[int], length: int, side: int) -> Complexes:
    step, frequency = prepared.whole_step, prepared.nominal
    turn = step * np.exp(-1j * frequency * step * np.arange(length))
    errors = []
    for place in places:
        true = prepared.whole[place - side : place + length + side]
        broken = true.copy()
        broken[side : side + length] = np.nan
        laid = bridge(broken, step, frequency, float(np.nan_to_num(prepared.noise_theta)))[0]
        errors.append(turn @ (laid - true)[side : side + length])
    return np.array(errors)


def _marks(prepared: Prepared, places: list[int], length: int, side: int, factor: int) -> Complexes:
    """All trials in one record, as far apart as not to feel each other."""
    step, frequency = prepared.whole_step / factor, prepared.nominal
    apart: list[int] = []
    for place in places:
        if all(abs(place - other) >= length + side for other in apart):
            apart.append(place)
    broken = prepared.observation.theta.copy()
    for place in apart:
        broken[place : place + length] = np.nan
    laid, *_ = upsample(broken, prepared.whole_step, prepared.rough_first_frequency, factor)
    error = laid - prepared.finer(prepared.whole_step, factor)
    turn = step * np.exp(-1j * frequency * step * np.arange((length + 2 * FILTER_REACH) * factor))
    begins = [(place - FILTER_REACH) * factor for place in apart]
    return np.array([turn @ error[begin : begin + turn.size] for begin in begins])
