"""What the time axis says of its own error: as large as the error is, on smooth and on rough drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mark_lists import Case, made

from pipeline.film.marks.axis import _mark_sigma, axis_of, lasting, times_of
from pipeline.film.marks.drive import NO_JUMPS, Drive, Model, drive, slips
from pipeline.film.parts import Floats, Marking

STEP = 0.5  # s
OBLIQUE = float(np.tan(np.radians(0.5)))
FILMS = {
    "clean": Case(),
    "typical": Case(walk=0.002, wow=0.003, drift=0.002, missing=0.01, spurious=2, shear=0.1 * OBLIQUE),
    "bad": Case(walk=0.003, wow=0.015, missing=0.1, spurious=10, shear=0.6 * OBLIQUE, offset=17.7),
    "wow": Case(missing=0.25, wow=0.03, shear=-OBLIQUE),
    "missing and spurious": Case(missing=0.2, spurious=20, walk=0.002, wow=0.003),
    "one trace": Case(traces=1, walk=0.002, wow=0.003),
}


@pytest.mark.compiled
@pytest.mark.parametrize("name", FILMS)
def test_errors_are_as_large_as_stated(name: str) -> None:
    wrong, stated = [], []
    for seed in range(3):
        case = Case(**{**FILMS[name].__dict__, "seed": seed, "minutes": 6.0})
        truth = made(case)
        axis = axis_of(truth.search(), truth.tracks, Marking())
        assert axis.shear == pytest.approx(case.shear, abs=1e-4)
        late = axis.seconds - truth.seconds
        late -= 60.0 * np.round(np.nanmedian(late) / 60.0)  # which minute it was, a film does not say
        for trace, course in enumerate(truth.tracks.course):
            lag = axis.offset[trace] - trace * case.offset + (axis.shear - case.shear) * course
            error = late - lag / case.speed
            seen = np.isfinite(error)
            wrong.append(error[seen])
            stated.append(axis.seconds_sigma[seen])
    ratio = np.sqrt(np.mean(np.concatenate(wrong) ** 2) / np.mean(np.concatenate(stated) ** 2))
    assert 0.7 < ratio < 1.4


@pytest.mark.parametrize("missing", [(), (201, 202, 203)])
def test_slip_is_found_between_the_marks_that_show_it(missing: tuple[int, ...]) -> None:
    """Wow of 1 %, marks read to .05 px; a single mark that lies 5 px off is no slip."""
    rng, at = np.random.default_rng(3), np.arange(400)
    rows = 29.5 * at + 0.15 * np.sin(2.0 * np.pi * at / 7.0) + 0.05 * rng.normal(size=(2, at.size))
    rows[:, 100] += 5.0
    assert slips(rows).size == 0
    rows[:, 201:] += 5.0
    rows[:, list(missing)] = np.nan
    assert slips(rows).tolist() == [201 + len(missing)]


@pytest.mark.compiled
@pytest.mark.parametrize(("rough", "shake"), [(0.3, 0.0), (0.0, 0.08), (0.0, 0.3)])
def test_rough_drives_are_told_from_smooth_ones(rough: float, shake: float) -> None:
    """Speed that walks, or acceleration that does, integrated finely; marks read with an error of 0.03 px."""
    rng = np.random.default_rng(2)
    fine, marks = 0.01, 800
    size = round(marks * STEP / fine)
    acceleration = np.cumsum(rough * np.sqrt(fine) * rng.normal(size=size))
    acceleration -= acceleration.mean()
    speed = 59.0 + np.cumsum(acceleration * fine + shake * np.sqrt(fine) * rng.normal(size=size))
    at = np.cumsum(speed) * fine
    true = at[:: round(STEP / fine)]
    noisy = (true + 0.03 * rng.normal(size=true.size))[None]
    found = drive(noisy, np.full_like(noisy, 0.02), STEP)
    assert np.sqrt(np.mean(((found.row - true) / found.row_sigma) ** 2)) == pytest.approx(1.0, abs=0.25)
    assert np.hypot(0.02, found.model.floor) == pytest.approx(0.03, rel=0.2)


@pytest.mark.compiled
def test_what_a_shutter_does_to_all_traces_is_no_error_of_each() -> None:
    """Three traces of a mark share its jitter: their mean is no better than that, however many there are."""
    rng, at = np.random.default_rng(4), STEP * np.arange(600)
    true = 59.0 * at + np.cumsum(np.cumsum(0.004 * rng.normal(size=at.size))) * STEP
    jitter, apart = 0.03 * rng.normal(size=at.size), 0.02 * rng.normal(size=(3, at.size))
    noisy = true + jitter + np.hypot(1.0, 0.5) * apart
    found = drive(noisy, np.full_like(noisy, 0.02), STEP)
    assert found.model.floor == pytest.approx(0.03, rel=0.15)
    assert found.model.own == pytest.approx(0.01, rel=0.3)
    assert np.sqrt(np.mean(((found.row - true) / found.row_sigma) ** 2)) == pytest.approx(1.0, abs=0.25)


def plain(marks: int, shake: float) -> Drive:
    one = np.ones(marks)
    used = np.ones((2, marks), dtype=bool)
    row = 10.0 + 29.5 * np.arange(marks)
    model = Model(STEP, -12.0, float(np.log(shake)), 0.02)
    return Drive(model, row, 59.0 * one, 0.0 * one, 0.01 * one, 0.1 * one, used, NO_JUMPS, 0.0)


def test_between_marks_a_rough_drive_is_less_sure() -> None:
    found = plain(20, 1.0)
    seconds, sigma = times_of(found, 560, 0.0)
    known = np.isfinite(seconds)
    at_marks, between = (np.interp(when, seconds[known], sigma[known]) for when in (5.0, 5.25))
    assert at_marks == pytest.approx(0.01 / 59.0, rel=0.02)
    # a walk of the speed held at both ends: variance shake^2 h^3 / 192 in the middle
    assert between == pytest.approx(np.hypot(0.01, np.sqrt(STEP**3 / 192.0)) / 59.0, rel=0.01)
    _, more = times_of(found, 560, 0.05)
    assert np.allclose(more[known] ** 2 - sigma[known] ** 2, (0.05 / 59.0) ** 2, rtol=1e-6)


def test_a_mark_alone_behind_a_stand_gives_no_times() -> None:
    seconds, _ = times_of(replace(plain(20, 1.0), jumps=np.array([19])), 600, 0.0)
    known = np.flatnonzero(np.isfinite(seconds))
    assert known[[0, -1]] == pytest.approx([10, 10 + 29.5 * 18], abs=1.0)


@pytest.mark.parametrize("run", [1, 5, 30])
def test_marks_missing_side_by_side_are_late_together(run: int) -> None:
    """Their errors add up within a run: a tenth of the marks, each doubtful by s, are noise of sqrt(run / 10) s."""
    found = plain(600, 1e-9)
    missing = (np.arange(600) // run) % 10 == 3
    used = np.broadcast_to(~missing, (2, 600))
    row_sigma = np.where(missing, 0.6, 0.0)
    doubtful = replace(found, used=used, row_sigma=row_sigma)
    noise = _mark_sigma(np.tile(found.row, (2, 1)), np.full((2, 600), 0.01), doubtful, 0.0)
    assert noise == pytest.approx(0.6 * np.sqrt(0.1 * run) / 59.0, rel=0.01)


def test_errors_that_last_are_told_by_the_traces_apart() -> None:
    rng = np.random.default_rng(1)
    found = plain(2000, 1e-3)

    def slow(size: float) -> Floats:
        walk = np.convolve(rng.normal(size=2040), np.ones(20) / np.sqrt(20.0), "valid")[:2000]
        return np.asarray(found.row + size * walk)

    white = found.row + 0.03 * rng.normal(size=(2, 2000))
    assert lasting(white, found) < 0.005
    assert lasting(np.stack([slow(0.05), slow(0.05)]), found) == pytest.approx(0.05 / np.sqrt(2.0), rel=0.25)
    paper = found.row + slow(0.5) - found.row  # what both traces show is the paper's
    assert lasting(np.stack([paper, paper]), found) == 0.0
    assert lasting(white[:1], replace(found, used=found.used[:1])) == pytest.approx(0.3 * found.model.floor)
