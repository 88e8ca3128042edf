"""Time axis and strobe from pixels: phases, marks that are missing, skew, and dense bands of slow films."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_film import Film, film

from data_schemas.errors import RefusedError
from pipeline.film.marks.axis import axis_of
from pipeline.film.marks.numbering import shear_of_marks
from pipeline.film.marks.search import search_gaps
from pipeline.film.parts import Marking, Strobe, TimeAxis, Tracks
from pipeline.film.strobe.dense import dense_tracks, standing
from pipeline.film.strobe.dense_survey import survey
from pipeline.film.strobe.reading import GAP, read_at_marks

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


@pytest.mark.parametrize("shear", [0.0, 0.00873, -0.00873])
def test_a_slow_film_is_read_at_its_marks(shear: float) -> None:
    """1.5 mm/s: strokes lie nine rows apart and no row shows a line by itself; the slit askew by half a degree."""
    made = film(40.0, speed=17.717, shear=shear, **PAIR)
    plain = survey(made.scan, made.emulsion, 2)
    stands = standing(made.scan, made.emulsion, plain).shear
    assert stands == pytest.approx(shear, abs=3e-3)
    assert shear != 0.0 or stands == 0.0
    tracks = dense_tracks(made.scan, replace(made.emulsion, shear=stands), 2)
    if shear != 0.0:
        stands = shear_of_marks(search_gaps(made.scan, made.emulsion, tracks, Marking()).gaps, tracks)
        assert stands == pytest.approx(shear, abs=1e-3)
        tracks = dense_tracks(made.scan, replace(made.emulsion, shear=stands), 2)
    assert tracks.rows_per_swing == pytest.approx(1.0097 * 17.717, rel=2e-3)
    for trace in range(2):
        away = (tracks.course[trace] - made.tracks.course[trace]) / np.hypot(1.0, made.tracks.slope[trace])
        assert np.nanmedian(np.abs(away)) < (0.1 if shear == 0.0 else 0.2)
        assert np.isfinite(tracks.course[trace]).mean() > 0.9
    axis = axis_by_gaps(made, tracks, Marking())
    strobe = read_at_marks(made.scan, made.emulsion, tracks, axis)
    shift = shift_of(made, axis)
    for trace in range(2):
        away = strobe.position[trace] - true_columns(made, strobe, trace, shift)
        assert np.nanmedian(np.abs(away)) < 0.4
        assert np.isfinite(away).mean() > 0.85


def test_a_film_without_bands_is_refused() -> None:
    made = film(10.0)
    image = np.full_like(made.scan.image, 229)
    image += np.random.default_rng(0).integers(0, 9, image.shape, dtype=np.uint8)
    with pytest.raises(RefusedError, match="film:"):
        dense_tracks(type(made.scan)(image), made.emulsion, None)
