"""After a blackout: told by amplitude and phase, or not told at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.film.tracking.pieces import Swing
from pipeline.film.tracking.track import match


@dataclass
class Found:
    swings: tuple[Swing, ...]


def a_swing(middle, amplitude, phase, row=1000.5, w=0.1):
    state = np.array([middle, 0.0, 0.0, amplitude * np.cos(phase), amplitude * np.sin(phase), w])
    return Swing(row, state, 1.0)


def before(middle, amplitude, phase, row=400.5, w=0.1):
    return row, a_swing(middle, amplitude, phase + w * (row - 1000.5)).state


def test_traces_are_told_by_phase_though_the_paper_ran_fast():
    last = [before(500.0, 100.0, 0.5), before(505.0, 102.0, 2.5)]
    for slip in (0.0, 0.4, -0.5):
        found = Found((a_swing(520.0, 99.0, 2.5 + slip), a_swing(490.0, 101.0, 0.5 + slip)))
        assert match(found, last) == [1, 0]


def test_traces_are_told_by_amplitude():
    last = [before(500.0, 60.0, 0.5), before(500.0, 120.0, 0.6)]
    assert match(Found((a_swing(500.0, 118.0, 0.5), a_swing(500.0, 61.0, 0.6))), last) == [1, 0]


def test_twins_are_not_told_apart():
    last = [before(500.0, 100.0, 0.5), before(501.0, 100.0, 0.6)]
    assert match(Found((a_swing(500.0, 100.0, 0.53), a_swing(501.0, 100.0, 0.57))), last) == []


def test_one_of_two_is_known_again():
    last = [before(500.0, 60.0, 0.5), before(700.0, 120.0, 0.6)]
    assert match(Found((a_swing(700.0, 118.0, 0.6),)), last) == [1]
    assert match(Found((a_swing(700.0, 30.0, 3.6),)), last) == []
