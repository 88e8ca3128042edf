"""The curve through the samples: a spline of degree 5, piece by piece in bounded memory."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synth.film.source import Blocks, Source
from synth.phase import Floats

_BESIDE = 64  # samples beyond a block that its spline sees: what lies further away counts 0.43^64 = 1e-23
_DEGREE = 5


@dataclass(frozen=True)
class _Piece:
    """The curves of all traces over one block of samples."""

    begin: float
    end: float
    curves: list[_Curve]


class _Curve:
    """One trace over one block: a spline through every unbroken run of samples, straight lines between runs."""

    def __init__(self, time: Floats, values: Floats, longest: float, beyond: float) -> None:
        from scipy.interpolate import make_interp_spline

        good = np.isfinite(values)
        self._time, self._values, self._beyond = time[good], values[good], beyond
        self._splines: list[tuple[float, float, Any]] = []
        for run in runs(time, values, longest):
            if run.size > 1:
                spline = make_interp_spline(time[run], values[run], k=min(_DEGREE, run.size - 1))
                self._splines.append((float(time[run[0]]), float(time[run[-1]]), spline))

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Value and rate."""
        if not self._time.size:
            return np.zeros(times.size), np.zeros(times.size)
        value, rate = np.interp(times, self._time, self._values), np.zeros(times.size)
        for begin, end, spline in self._splines:
            here = slice(*np.searchsorted(times, [begin - self._beyond, end + self._beyond]))
            value[here], rate[here] = spline(times[here]), spline(times[here], 1)
        return value, rate


class Course:
    """The elongation of every trace at any time, asked for in order of time.

    Parameters
    ----------
    source
    node : float
        How far beyond a run of samples its curve is wanted, s.
    """

    def __init__(self, source: Source, node: float) -> None:
        self._longest, self._node = source.longest, node
        self._coming = self._pieces(source.blocks())
        self._pieces_held: deque[_Piece] = deque()

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Elongation and its rate, (traces, times) rad and rad/s, at increasing times; none may lie before the last
        call's first.
        """
        held = self._pieces_held
        while held and held[0].end <= times[0]:
            held.popleft()
        while not held or held[-1].end <= times[-1]:
            piece = next(self._coming, None)
            if piece is None:
                break
            if piece.end > times[0]:
                held.append(piece)
        found = []
        for piece in held:
            here = times[(times >= piece.begin) & (times < piece.end)]
            found.append([curve.at(here) for curve in piece.curves])
        traces = range(len(found[0]))
        value = np.array([np.concatenate([piece[trace][0] for piece in found]) for trace in traces])
        rate = np.array([np.concatenate([piece[trace][1] for piece in found]) for trace in traces])
        return value, rate

    def _pieces(self, blocks: Blocks) -> Any:
        before: tuple[Floats, Floats] | None = None
        here = next(blocks)
        begin = -np.inf
        while True:
            after = next(blocks, None)
            near = [here]
            if before is not None:
                near.insert(0, (before[0][-_BESIDE:], before[1][:, -_BESIDE:]))
            if after is not None:
                near.append((after[0][:_BESIDE], after[1][:, :_BESIDE]))
            time = np.concatenate([each[0] for each in near])
            values = np.concatenate([each[1] for each in near], axis=1)
            end = np.inf if after is None else float(after[0][0])
            yield _Piece(begin, end, [_Curve(time, row, self._longest, self._node) for row in values])
            if after is None:
                return
            before, here, begin = here, after, end


def runs(time: Floats, values: Floats, longest: float) -> list[NDArray[np.intp]]:
    """Indices of samples that follow each other without a NaN or a long pause between them.

    Examples
    --------
    >>> [run.tolist() for run in runs(np.arange(6.0), np.array([1, 2, np.nan, 3, 4, 5]), 1.5)]
    [[0, 1], [3, 4, 5]]
    """
    good = np.flatnonzero(np.isfinite(values))
    broken = (np.diff(good) > 1) | (np.diff(time[good]) > longest)
    return [run for run in np.split(good, np.flatnonzero(broken) + 1) if run.size]
