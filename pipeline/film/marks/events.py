"""Gaps of all traces brought together: each closing of the shutter once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks.alignment import Alignment
from pipeline.film.marks.gaps import Gaps
from pipeline.film.parts import Floats

TOGETHER = 0.6  # of a gap's width, or one pixel


@dataclass(frozen=True)
class Events:
    """Closings of the shutter, in order.

    Attributes
    ----------
    row, row_sigma : (events,) arrays
        At column 0 of the first trace, px.
    width, width_sigma : (events,) arrays
        Rows.
    member : (traces, events) array of int64
        Which gap shows it on each trace; -1 where none does.
    """

    row: Floats
    row_sigma: Floats
    width: Floats
    width_sigma: Floats
    member: NDArray[np.int64]

    @property
    def size(self) -> int:
        """Number of events."""
        return self.row.size


def gathered(gaps: Gaps, alignment: Alignment, traces: int, width: float) -> Events:
    """Gaps that lie together on different traces taken for one event."""
    rows = alignment.rows(gaps)
    order = np.argsort(rows, kind="stable")
    limit = max(TOGETHER * width, 1.0)
    groups: list[list[int]] = []
    for at in order:
        last = groups[-1] if groups else []
        if last and rows[at] - rows[last[0]] < limit and gaps.trace[at] not in gaps.trace[last]:
            last.append(int(at))
        else:
            groups.append([int(at)])
    member = np.full((traces, len(groups)), -1, dtype=np.int64)
    row, sigma, wide, wide_sigma = (np.empty(len(groups)) for _ in range(4))
    for k, group in enumerate(groups):
        weight = gaps.row_sigma[group] ** -2.0
        row[k], sigma[k] = np.sum(weight * rows[group]) / weight.sum(), weight.sum() ** -0.5
        weight = gaps.width_sigma[group] ** -2.0
        wide[k], wide_sigma[k] = np.sum(weight * gaps.width[group]) / weight.sum(), weight.sum() ** -0.5
        member[gaps.trace[group], k] = group
    order = np.argsort(row, kind="stable")
    return Events(row[order], sigma[order], wide[order], wide_sigma[order], member[:, order])
