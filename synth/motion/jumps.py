"""Jumps in a recorded acceleration: band-limited interpolation would ring about them, so they are refused.

At each place between two readings, what the readings before it promise is compared with what those after it do, by
their last value and by the straight line through the last two. A jump is a difference that is large for the table, and
many times larger than all that follow and precede it nearby. Waves and noise are large everywhere they are large
somewhere; quantised readings step by a small part of the table; a blow of three readings is no jump either.
"""

from __future__ import annotations

import numpy as np

from synth.phase import Floats

_LARGE = 0.2  # of the range of the table
_ALONE = 8.0  # times all neighbours: white noise of 1e7 readings has no such place
_NEIGHBOURS = 15  # places to either side that it is compared with
_FEWEST = 12  # neighbours without which nothing is told
_GAP = 1.5  # typical steps: across a longer one, a wave too comes far


def first_jump(seconds: Floats, values: Floats) -> int | None:
    """Place of the reading before the first jump, or None.

    Parameters
    ----------
    seconds, values : (readings,)
        Times, increasing, and what was read.

    Examples
    --------
    >>> seconds = np.arange(100.0)
    >>> swell = np.cos(0.6 * seconds)
    >>> first_jump(seconds, swell) is None
    True
    >>> first_jump(seconds, swell + (seconds > 40.0))
    40
    """
    steps, rises = np.diff(seconds), np.diff(values)
    if rises.size <= _FEWEST + 1:
        return None
    bent = rises.copy()  # in line with the slopes before and after: nothing
    bent[1:-1] -= 0.5 * (rises[:-2] + rises[2:])
    bent[[0, -1]] = 0.0
    least = _LARGE * float(np.ptp(values))
    near = steps <= _GAP * float(np.median(steps))
    found = (_alone(rises, 2) | _alone(bent, 3)) & (np.abs(rises) > least) & near
    places = np.flatnonzero(found)
    return int(places[0]) if places.size else None


def _alone(differences: Floats, nearest: int) -> np.ndarray:
    """Where a difference is larger than all from `nearest` to _NEIGHBOURS places away."""
    size = np.abs(differences)
    padded = np.pad(size, _NEIGHBOURS)
    largest = np.zeros(size.size)
    for away in range(nearest, _NEIGHBOURS + 1):
        for begin in (_NEIGHBOURS - away, _NEIGHBOURS + away):
            np.maximum(largest, padded[begin : begin + size.size], out=largest)
    alone: np.ndarray = size > _ALONE * largest
    return alone
