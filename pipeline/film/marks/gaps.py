"""Gaps of the shutter as they were found on the traces, one by one."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks import gap_kernels
from pipeline.film.parts import Floats


@dataclass(frozen=True)
class Gaps:
    """Gaps on single traces, in order of their rows.

    Attributes
    ----------
    trace : (gaps,) array of int64
    row, row_sigma : (gaps,) arrays
        Row of the middle of the gap on the trace, px.
    column, column_sigma : (gaps,) arrays
        Column of the trace there, px, by the edges of the gap.
    slope : (gaps,) array
        Of the trace there, px px-1.
    width, width_sigma : (gaps,) arrays
        Rows for which the shutter was closed.
    depth, depth_sigma : (gaps,) arrays
        Share of the light that the shutter held off: 1.
    light : (gaps,) array
        Of the line around the gap, over that of its slope.
    misfit : (gaps,) array
        Mean square of the pixels' residuals over that of their grain.
    """

    trace: NDArray[np.int64]
    row: Floats
    row_sigma: Floats
    column: Floats
    column_sigma: Floats
    slope: Floats
    width: Floats
    width_sigma: Floats
    depth: Floats
    depth_sigma: Floats
    light: Floats
    misfit: Floats

    @staticmethod
    def of(trace: NDArray[np.int64], fitted: Floats) -> Gaps:
        """From what `gap_kernels.fit_gaps` returns, (gaps, RESULTS)."""
        names = {
            field.name: getattr(gap_kernels, field.name.upper()) for field in fields(Gaps) if field.name != "trace"
        }
        return Gaps(trace=trace, **{name: fitted[:, at].copy() for name, at in names.items()})

    def pick(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Gaps:
        """Some of them."""
        return Gaps(**{field.name: getattr(self, field.name)[which] for field in fields(Gaps)})

    @property
    def size(self) -> int:
        """Number of gaps."""
        return self.row.size
