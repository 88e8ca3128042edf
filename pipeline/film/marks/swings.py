"""The pendulums as a second clock: phases of the traces' swings at the marks.

Over a mark's interval a pendulum's phase advances by the same amount to 1e-3 and better, whatever the paper does; a
count of marks that slips by one shows as half a swing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks.alignment import Events
from pipeline.film.parts import Floats, Tracks

HALF = 0.75  # swings on either side in which the phase is fitted
LEAST = 4.0  # px, of the swing's amplitude
FARTHEST, CARRIED = 1.2, 0.3  # windows' halves over which a phase is carried; rad, 1 sigma, of one half
RANGE, STEP = (0.85, 1.15), 0.005  # speeds for which the fit is prepared
CENTRED = 1e-3  # rad2, least variance of a phase that was carried
NEAR = 8  # marks on either side over which a phase is averaged
EVEN, NEXT = 0.13, 0.06  # of the spacing, by which neighbouring marks may differ from it over the film, and locally


class Swings(NamedTuple):
    """Phases of the traces' swings at events, rad; NaN where unknown."""

    phase: Floats  # (traces, events)
    extra: Floats  # (traces, events), variance of each beside that of `sigma`
    advance: Floats  # (traces,), from mark to mark, -pi to pi
    sigma: Floats  # (traces,), 1 sigma of a phase
    lost: Floats  # (events,), rows before each event on which no trace is followed

    def at(self, which: slice | NDArray[np.int64]) -> Swings:
        """At some of the events."""
        return self._replace(phase=self.phase[:, which], extra=self.extra[:, which], lost=self.lost[which])

    @property
    def centred(self) -> Floats:
        """Phases that were not carried there; NaN for others."""
        return np.where(self.extra < CENTRED, self.phase, np.nan)


def swings_at(tracks: Tracks, events: Events, places: Floats, spacing: float) -> Swings:
    """Swings at events, which lie on each trace at `places` (traces, events); `spacing` is that of marks."""
    from scipy.ndimage import median_filter

    rows = events.row
    apart, stretch = np.diff(rows), np.ones(rows.size)  # rows per second over the film's mean, by the neighbours
    good = np.abs(apart - spacing) < EVEN * spacing
    if good.sum() >= 3:
        calm = median_filter(apart[good], 5, mode="nearest")
        stretch = np.asarray(np.interp(rows, 0.5 * (rows[1:] + rows[:-1])[good], calm) / spacing)
    lost = np.concatenate([[0], np.cumsum(~np.isfinite(tracks.course).any(axis=0))])
    before = lost[np.clip(np.round(rows), 0, lost.size - 1).astype(np.int64)].astype(np.float64)
    phase, extra = _phases(tracks, places, stretch)
    advance, sigma = np.full((2, len(places)), np.nan)
    swings = Swings(phase, extra, advance, sigma, before)
    next_one = np.abs(apart / (spacing * stretch[1:]) - 1.0) < NEXT
    for trace, each in enumerate(swings.centred):
        step = np.diff(each)[next_one]
        step = step[np.isfinite(step)]
        if step.size < 8:
            continue
        centre = np.angle(np.exp(1j * step).sum())
        for _ in range(5):
            centre += np.median(np.angle(np.exp(1j * (step - centre))))
        away = np.angle(np.exp(1j * (step - centre)))
        advance[trace], sigma[trace] = centre, max(1.4826 * float(np.median(np.abs(away))), 0.01)
    return swings._replace(extra=extra + (2.0 * np.pi / tracks.rows_per_swing * events.row_sigma) ** 2)


def _phases(tracks: Tracks, rows: Floats, stretch: Floats) -> tuple[Floats, Floats]:
    """Phase of every trace's swing at rows of that trace, rad, and the variance it has from being carried there.

    Where the trace is lost near a row, the phase is that of the nearest whole piece, carried on at its frequency; both
    results are (traces, n), NaN where that is too far or the swing too small. `stretch` (n,) are the rows per second
    there over the film's mean.
    """
    from scipy.ndimage import distance_transform_edt, maximum_filter1d

    half = max(round(HALF * tracks.rows_per_swing), 3)
    x = np.arange(-half, half + 1.0)
    speed = np.round(np.clip(stretch, *RANGE) / STEP).astype(np.int64)
    out, extra = np.full((2, *rows.shape), np.nan)
    for trace, course in enumerate(tracks.course):
        broken = maximum_filter1d(~np.isfinite(course), 2 * half + 1)
        broken[:half] = broken[-half:] = True
        if broken.all():
            continue
        whole: Any = distance_transform_edt(broken, return_distances=False, return_indices=True)
        middle = np.nan_to_num(rows[trace], nan=-1e9) - 0.5
        near = whole[0][np.clip(np.round(middle), 0, course.size - 1).astype(np.int64)]
        carried = middle - near
        inside = np.abs(carried) <= FARTHEST * half
        for which in np.unique(speed[inside]):
            turn = 2.0 * np.pi / (tracks.rows_per_swing * which * STEP)
            taps = np.linalg.pinv(
                np.stack([np.cos(turn * x), np.sin(turn * x), *[(x / half) ** k for k in range(4)]]).T
            )
            at = np.flatnonzero(inside & (speed == which))
            cos, sin = taps[:2] @ course[near[at][:, None] + np.arange(-half, half + 1)].T
            phase = np.arctan2(-sin, cos) + turn * carried[at]
            out[trace, at] = np.where(np.hypot(cos, sin) > LEAST, phase, np.nan)
        extra[trace, inside] = (CARRIED * np.maximum(np.abs(carried[inside]) - 1.0, 0.0) / half) ** 2
    return out, extra


def jumps(index: Floats, swings: Swings) -> Floats:
    """Jump of the pendulums' phase at each mark of number `index`, the smallest of all traces, rad; NaN = unknown."""
    out = np.full((len(swings.phase), index.size), np.inf)
    for trace, (phase, advance) in enumerate(zip(swings.centred, swings.advance, strict=True)):
        known = np.flatnonzero(np.isfinite(phase) & np.isfinite(advance))
        if known.size >= 2 * NEAR:
            turned = np.exp(1j * (phase[known] - advance * index[known]))
            sums = np.convolve(turned, np.ones(NEAR), "valid")  # of NEAR marks, by their first
            out[trace, known[NEAR : known.size - NEAR + 1]] = np.abs(np.angle(sums[NEAR:] * np.conj(sums[:-NEAR])))
    least = out.min(axis=0)
    return np.where(np.isfinite(least), least, np.nan)
