"""What makes a film refused after it was followed: a trace not read, two on one line, something else on a line."""

from __future__ import annotations

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from pipeline.film.parts import Tracks
from pipeline.film.tracking.outcome import checked

ROWS, SPOT = 60, 1.2
ALONE = np.ones((2, ROWS), np.float32)


@pytest.fixture
def followed() -> Tracks:
    """Two traces apart, read on every row."""
    out = Tracks.empty(2, ROWS, 21.0, SPOT)
    out.course[:] = np.array([[100.0], [200.0]]) + 20.0 * np.sin(0.3 * np.arange(ROWS))
    out.slope[:] = 6.0 * np.cos(0.3 * np.arange(ROWS))
    out.position[:] = out.course
    return out


def test_what_is_read_well_passes(followed: Tracks) -> None:
    assert checked(followed, ALONE) is followed


def test_a_line_on_which_something_else_lies_is_refused(followed: Tracks) -> None:
    misfit = ALONE.copy()
    misfit[1, :20] = 9.0
    with pytest.raises(RefusedError, match=r"trace 2 of the film does not look like one line.*at most 8"):
        checked(followed, misfit)
    misfit[1, :20] = 17.0
    with pytest.raises(RefusedError, match="at most 16 is"):
        checked(followed, misfit, 2.0)
    checked(followed, misfit, 2.5)  # finer grain than what is known of lines


def test_a_trace_that_is_hardly_read_is_refused(followed: Tracks) -> None:
    followed.position[1, 3:] = np.nan
    with pytest.raises(RefusedError, match="trace 2 of the film was found but read on 5 %"):
        checked(followed, ALONE)
    followed.position[:, 3:] = np.nan
    with pytest.raises(RefusedError, match="no swinging trace"):
        checked(followed, ALONE)


def test_two_traces_on_one_line_are_refused(followed: Tracks) -> None:
    followed.course[1] = followed.course[0] + 0.5 * SPOT
    with pytest.raises(RefusedError, match="traces 1 and 2 of the film lie on each other"):
        checked(followed, ALONE)
    followed.course[1] = np.nan
    checked(followed, ALONE)
