"""How far the support moves with the clocks, where its acceleration was recorded.

A beam that yields up and down swings at twice the clocks' frequency, a frame that yields sideways at their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats

_MULTIPLES = {"vertical_acceleration": 2.0, "horizontal_acceleration": 1.0}


class Beam(NamedTuple):
    """Motion of the support at a multiple of the clocks' frequency."""

    direction: str
    """``vertical`` or ``horizontal``."""
    amplitude: float
    """m."""
    ratio: Floats
    """(clocks,) amplitude of the support over that of the clock, m/rad."""


def beam(
    time: Floats, accelerations: Mapping[str, Floats], frequency: float, amplitude: Floats, since: float
) -> Beam | None:
    """The larger of what the recorded accelerations show, None if none was recorded.

    Parameters
    ----------
    time : (n,) array
        s.
    accelerations : mapping of str to (n,) array
        As in the record, m s-2; NaN = missing.
    frequency : float
        Of the clocks, rad/s.
    amplitude : (clocks,) array
        Mean, rad.
    since : float
        Time from which the motion counts, s.
    """
    found = []
    for name, multiple in _MULTIPLES.items():
        values = accelerations.get(name)
        if values is None:
            continue
        used = np.isfinite(values) & (time >= since)
        if used.sum() < 16:
            continue
        turn = multiple * frequency
        window = np.hanning(int(used.sum()))
        carrier = np.exp(-1j * turn * time[used])
        felt = np.abs(2.0 * np.sum(window * (values[used] - values[used].mean()) * carrier) / window.sum())
        size = float(felt) / turn**2
        found.append(Beam(name.partition("_")[0], size, size / amplitude))
    return max(found, key=lambda each: each.amplitude, default=None)
