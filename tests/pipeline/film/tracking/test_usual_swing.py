"""Rows in a swing as the traces that were followed show them, whatever one section of the film had said."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.film.parts import Tracks
from pipeline.film.tracking.track import usual_swing


@pytest.mark.parametrize("shear", [0.0, 0.012])
def test_turns_tell_the_rows_in_a_swing(shear: float) -> None:
    """Also where the slit lies askew, which shifts turns to either side alike, and with a gap."""
    tracks = Tracks.empty(2, 3000, 30.6, 1.8)
    row = np.arange(3000) + 0.5
    for trace, (period, size) in enumerate(((33.39, 127.0), (33.40, 90.0))):
        turn = 2.0 * np.pi / period
        at = row - shear * size * np.cos(turn * row)
        tracks.slope[trace] = -size * turn * np.sin(turn * at) + 0.02 * np.cos(0.05 * row)
    tracks.slope[:, 900:1200] = np.nan
    assert usual_swing(tracks) == pytest.approx(33.395, abs=0.02)


def test_without_turns_it_is_as_told_before() -> None:
    assert usual_swing(Tracks.empty(1, 50, 30.6, 1.8)) == 30.6
