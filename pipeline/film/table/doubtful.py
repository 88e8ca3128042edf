"""Places of a film that a person should look at, in order of what they may do to gravity."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.variables import ELONGATION_FLAGS
from pipeline.film.reading import Reading

G_MGAL = 9.81e5
MOST = 200
APART = 3  # swings, within which places are one
WRONG = 1.0  # spots, by which an ambiguous reading may be wrong
TOLD = {  # flags of the record: words for them, and the least length that is told, swings
    "lost": ("trace not followed", 0.5),
    "ambiguous": ("two ways along the film disagree", 0.1),
    "outlier": ("readings do not fit", 0.5),
    "saturated": ("too dark to read", 0.5),
}


def doubtful(reading: Reading, clock: Callable[[float], str]) -> list[dict[str, Any]]:
    """Places in order of harm; `harm_mgal` is by how much gravity moves if the place is as wrong as it may be.

    A phase wrong by d rad for s seconds at x from the middle of a record of length T changes its rate by 12 d s x /
    T^3, a step of the clock by t at the share y by 6 t y (1 - y) / T of itself; gravity by twice that, relative.
    """
    axis, tracks = reading.axis, reading.tracks
    known = np.flatnonzero(np.isfinite(axis.seconds))
    if known.size < 2:
        return []
    seconds = np.interp(np.arange(axis.seconds.size), known, axis.seconds[known])
    begin, end = float(seconds[0]), float(seconds[-1])
    places: list[dict[str, Any]] = []

    def note(first: int, last: int, trace: int | None, words: str, harm: float) -> None:
        place = {"first_row": float(first), "last_row": float(last + 1), "trace": trace, "what": words}
        places.append(place | {"harm_mgal": harm, "time": clock(float(seconds[min(first, seconds.size - 1)]))})

    def of_step(by: float, at: float) -> float:
        """Change of gravity by a step of the clock, mGal."""
        share = float(np.clip((at - begin) / (end - begin), 0.0, 1.0))
        return 2.0 * G_MGAL * 6.0 * by * share * (1.0 - share) / (end - begin)

    for start, stop, by in axis.doubts:
        low, high = np.searchsorted(seconds, [start, stop]).tolist()
        harm = of_step(by, 0.5 * (start + stop))
        note(low, min(high, seconds.size - 1), None, f"marks may be miscounted, by {by:g} s", harm)
    missing = np.diff(axis.index) - 1
    for at in np.flatnonzero(missing > 3):
        harm = 0.1 * of_step(axis.interval, float(axis.index[at] * axis.interval))
        note(int(axis.row[at]), int(axis.row[at + 1]), None, f"{missing[at]} marks missing", harm)
    for first, last in _runs(~np.isfinite(axis.seconds), 1.0):
        if first > 0 and last < axis.seconds.size - 1:
            note(first, last, None, "the paper stood still", 0.1 * of_step(axis.interval, float(seconds[first])))
    rate = 2.0 * np.pi / tracks.rows_per_swing * float(axis.seconds.size - 1) / max(seconds[-1] - seconds[0], 1e-9)
    for trace, qc in enumerate(tracks.qc):
        size = 0.5 * float(np.ptp(np.nanpercentile(tracks.course[trace], (2, 98))))
        for name, (words, least) in TOLD.items():
            which = ((qc & ELONGATION_FLAGS[name]) > 0) & np.isfinite(axis.seconds)
            for first, last in _runs(which, APART * tracks.rows_per_swing if name != "lost" else 1.0):
                length = float(seconds[last] - seconds[first])
                if length * rate / (2.0 * np.pi) < least:
                    continue
                middle = 0.5 * float(seconds[first] + seconds[last]) - 0.5 * (begin + end)
                phase = WRONG * tracks.spot / max(size, tracks.spot) * float(which[first : last + 1].mean())
                turned = 12.0 * phase * length * abs(middle) / (end - begin) ** 3
                note(first, last, trace + 1, words, 2.0 * turned / rate * G_MGAL)
    return sorted(places, key=lambda each: -each["harm_mgal"])[:MOST]


def _runs(which: NDArray[np.bool_], apart: float) -> list[tuple[int, int]]:
    """First and last rows of stretches that lie farther apart than so many rows."""
    rows = np.flatnonzero(which)
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > max(apart, 1.0)) + 1)
    return [(int(run[0]), int(run[-1])) for run in runs if run.size]
