"""Time axis and strobe from pixels: phases, marks that are missing, skew, and dense bands of slow films."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from small_film import Film, film

from data_schemas.errors import RefusedError
from pipeline.film.marks.axis import axis_of
from pipeline.film.marks.dense import dense_tracks
from pipeline.film.marks.numbering import shear_of_marks
from pipeline.film.marks.search import search_gaps
from pipeline.film.marks.strobe import GAP, read_at_marks
from pipeline.film.marks.survey import Lie, lie_of
from pipeline.film.parts import Marking, Strobe, TimeAxis, Tracks
from pipeline.film.scan.files import in_memory
from pipeline.film.scan.opening import OpenScan

pytestmark = pytest.mark.compiled
PAIR = {"sizes": (70.0, 60.0), "middles": (110.0, 300.0), "periods": (1.00966, 1.00976), "phases": (0.4, 2.2)}


def axis_by_gaps(made: Film, tracks: Tracks, marking: Marking) -> TimeAxis:
    return axis_of(search_gaps(made.scan, made.emulsion, tracks, marking), tracks, marking)


def both(made: Film, marking: Marking = Marking()) -> tuple[TimeAxis, Strobe]:  # noqa: B008
    axis = axis_by_gaps(made, made.tracks, marking)
    return axis, read_at_marks(made.scan, made.emulsion, made.tracks, axis)


def true_columns(made: Film, strobe: Strobe, trace: int, shift: float) -> np.ndarray:
    time = strobe.index * 0.5 + shift
    size, middle = {0: (70.0, 110.0), 1: (60.0, 300.0)}[trace]
    return middle + size * np.cos(2 * np.pi * time / made.periods[trace] + made.phases[trace])


def shift_of(made: Film, axis: TimeAxis) -> float:
    """Whole marks by which the axis counts from elsewhere (no full minute with a code is needed)."""
    row = axis.row + axis.offset[0] + axis.shear * 110.0
    true = np.interp(row - axis.shear * 110.0, *made.clock)
    return float(np.round(2.0 * np.median(true - axis.index * 0.5)) / 2.0)


@pytest.mark.parametrize(("shear", "offset"), [(0.0, 0.0), (0.00873, 17.7)])
def test_phase_by_strobe_is_good_to_half_a_milliradian(shear: float, offset: float) -> None:
    made = film(30.0, shear=shear, offset=offset, code=0.125, missing=(121, *range(123, 160, 4)), **PAIR)
    axis, strobe = both(made)
    shift = shift_of(made, axis)
    assert axis.shear == pytest.approx(shear, abs=4e-4)
    for trace in range(2):
        good = np.isfinite(strobe.position[trace])
        time = (strobe.index * 0.5 + shift)[good]
        turn = 2 * np.pi / made.periods[trace]
        basis = np.stack([np.cos(turn * time), np.sin(turn * time), np.ones(time.size)]) / strobe.sigma[trace][good]
        cos, sin, _ = np.linalg.lstsq(basis.T, strobe.position[trace][good] / strobe.sigma[trace][good], rcond=None)[0]
        phase = np.angle(np.exp(1j * (np.arctan2(-sin, cos) - made.phases[trace])))
        assert abs(phase) < 1e-3  # the bar is 5e-3
        assert good.mean() > 0.75


def test_places_are_within_their_sigma() -> None:
    made = film(40.0, **PAIR)
    axis, strobe = both(made)
    shift = shift_of(made, axis)
    for trace in range(2):
        away = (strobe.position[trace] - true_columns(made, strobe, trace, shift)) / strobe.sigma[trace]
        assert 0.5 < np.sqrt(np.nanmean(away**2)) < 1.5


def test_marks_that_were_never_made_are_not_read() -> None:
    missing = (125, 126, 140)
    made = film(30.0, missing=missing, **PAIR)
    axis, strobe = both(made)
    number = strobe.index + round(2.0 * shift_of(made, axis))
    for trace in range(2):
        gone = np.isin(number, missing)
        assert gone.sum() == len(missing)
        assert np.all(np.isnan(strobe.position[trace][gone]))
        assert np.all(strobe.qc[trace][gone] == GAP)
        assert np.isfinite(strobe.position[trace][~gone]).mean() > 0.95


def test_rows_are_timed_to_a_tenth_of_a_millisecond() -> None:
    made = film(40.0, **PAIR)
    axis, _ = both(made)
    known = np.isfinite(axis.seconds)
    row = (np.arange(made.scan.rows) + 0.5)[known]
    late = axis.seconds[known] + shift_of(made, axis) - np.interp(row, *made.clock)
    assert np.std(late) < 1e-4
    assert np.abs(late).max() < 1e-3


def test_a_slow_film_is_read_at_its_marks() -> None:
    """1.5 mm/s: strokes lie nine rows apart and no row shows a line by itself."""
    made = film(40.0, speed=17.717, **PAIR)
    tracks = dense_tracks(made.scan, made.emulsion, 2)
    assert tracks.rows_per_swing == pytest.approx(1.0097 * 17.717, rel=2e-3)
    for trace in range(2):
        away = (tracks.course[trace] - made.tracks.course[trace]) / np.hypot(1.0, made.tracks.slope[trace])
        assert np.nanmedian(np.abs(away)) < 0.1
        assert np.isfinite(tracks.course[trace]).mean() > 0.9
    axis = axis_by_gaps(made, tracks, Marking())
    strobe = read_at_marks(made.scan, made.emulsion, tracks, axis)
    shift = shift_of(made, axis)
    for trace in range(2):
        away = strobe.position[trace] - true_columns(made, strobe, trace, shift)
        assert np.nanmedian(np.abs(away)) < 0.4
        assert np.isfinite(away).mean() > 0.85


@pytest.mark.parametrize(
    ("lean", "shear"), [(0.0, 0.0), (0.0, 0.00873), (0.0, -0.00873), (0.0087, -0.0087), (-0.0175, 0.0)]
)
def test_a_slow_film_that_lies_askew_is_set_upright(lean: float, shear: float) -> None:
    """The slit askew by half a degree, the scan turned, and both: bands run down and rows are the slit's."""
    straight, made = film(40.0, speed=17.717, **PAIR), film(40.0, speed=17.717, shear=shear, **PAIR)
    rows, columns = made.scan.image.shape
    beside = 10 + math.ceil(abs(lean) * rows)
    at = np.mgrid[0.0:rows, -beside : columns + beside]
    at[1] -= lean * at[0]  # bands run aside, the slit as it was
    scan = OpenScan(in_memory(map_coordinates(made.scan.image, at, order=3, mode="nearest"), Path("a.tif")), None, ())
    found = lie_of(scan, 2)
    assert found.lean == pytest.approx(lean, abs=3e-4)
    assert found.shear == pytest.approx(shear, abs=4e-3)  # by the swings of so short a film
    assert found == Lie() or lean or shear
    upright = scan.straightened(*found)
    tracks = dense_tracks(upright, made.emulsion, 2)
    late = shear_of_marks(search_gaps(upright, made.emulsion, tracks, Marking()).gaps, 2)
    assert found.shear + late == pytest.approx(shear, abs=1e-3)
    upright = scan.straightened(lean, shear)
    tracks, aside = dense_tracks(upright, made.emulsion, 2), beside + max(math.ceil(lean * rows), 0)
    row = np.arange(upright.rows) + math.ceil(max(-shear, 0.0) * upright.columns) + shear * aside
    for trace in range(2):
        course, slope = (
            np.interp(row, np.arange(len(each)), each)
            for each in (straight.tracks.course[trace], straight.tracks.slope[trace])
        )
        away = (tracks.course[trace] - course - aside) / np.hypot(1.0, slope)
        assert np.nanmedian(np.abs(away)) < 0.1


def test_a_film_without_bands_is_refused() -> None:
    made = film(10.0)
    image = np.full_like(made.scan.image, 229)
    image += np.random.default_rng(0).integers(0, 9, image.shape, dtype=np.uint8)
    with pytest.raises(RefusedError, match="film:"):
        dense_tracks(type(made.scan)(image), made.emulsion, None)
