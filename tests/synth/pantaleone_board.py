"""Metronomes as Pantaleone (2002) writes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from synth.systems.resistance import VanDerPolDrive
from synth.systems.yielding import Metronomes


def pantaleone(detuning: ArrayLike, drive: float, drive_angle: float, coupling: float) -> Metronomes:
    """Metronomes in Pantaleone's own form, time in radians of the mean metronome.

    Parameters
    ----------
    detuning : (metronomes,)
        D_i.
    drive, drive_angle, coupling : float
        mu, th0 in rad, b.

    Examples
    --------
    >>> pantaleone([0.21, 0.0], 0.01, 0.39, 0.05).natural_frequency.tolist()
    [1.1, 1.0]
    """
    frequencies = np.sqrt(1.0 + np.asarray(detuning, dtype=np.float64))
    alike = np.ones(frequencies.size)
    escapement = VanDerPolDrive(drive * alike, drive_angle * alike)
    return Metronomes(frequencies, coupling, escapement)
