"""Gaps fitted to pixels: as good as the grain allows, on steep strokes and in turning points; none on blank film."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_film import FOG, SCAN_RANGE, Film, Pixels, film

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Gaps
from pipeline.film.marks.gap_kernels import Known, fit_gaps
from pipeline.film.marks.search import find_gaps, learned_width

pytestmark = pytest.mark.compiled
WIDTH = 0.03 * 59.055


def found(made: Film, width: float = WIDTH) -> Gaps:
    return find_gaps(made.scan, made.emulsion, made.tracks, width)[0]


def errors(made: Film, gaps: Gaps) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nearest true gap of each found one: which, and errors along and across the film, px."""
    which = np.argmin(np.abs(gaps.row[:, None] - made.row[0][None, :]), axis=1)
    return which, gaps.row - made.row[0][which], gaps.column - made.column[0][which]


@pytest.fixture(scope="module")
def minute() -> Film:
    """Gaps at all phases of the swing: they move by 0.03 rad from mark to mark."""
    return film(60.0, seed=4)


def test_nearly_all_gaps_are_found_and_no_others(minute: Film) -> None:
    which, along, _ = errors(minute, found(minute))
    assert np.abs(along).max() < 0.3
    assert np.unique(which).size >= 0.97 * (minute.when.size - 2)


def test_rows_are_good_to_a_twentieth_of_a_pixel(minute: Film) -> None:
    _, along, _ = errors(minute, found(minute))
    assert np.sqrt(np.mean(along**2)) < 0.05  # the bar is 0.2
    assert abs(np.mean(along)) < 0.01


def test_columns_on_steep_strokes_reach_the_bound_of_the_grain(minute: Film) -> None:
    """Two edges of a Gaussian line of exposure 1/sqrt(1+slope2): sigma of the column from grain at half its light."""
    gaps = found(minute)
    steep = np.abs(gaps.slope) > 6.0
    _, _, across = errors(minute, gaps)
    light = 1.0 / np.hypot(1.0, np.median(np.abs(gaps.slope[steep])))
    grain = float(minute.emulsion.noise(np.array([0.5 * light], dtype=np.float32))[0])
    bound = np.sqrt(2.0) * grain / light / np.sqrt(2.0)  # one edge; half of that variance for their middle
    assert np.std(across[steep]) < 1.3 * bound
    assert np.std(across[steep] / gaps.column_sigma[steep]) < 1.4


@pytest.mark.parametrize("shear", [0.0175, -0.03])
def test_gaps_under_a_slanted_slit_are_late_by_the_slant_alone(shear: float) -> None:
    """Its light is uneven along a line that bends: taken for even, gaps come out up to 3 % less late than they are."""
    made = film(60.0, gap=0.06, shear=shear, course_error=0.0, grain=0.02, seed=5)
    made = replace(made, tracks=replace(made.tracks, shear=shear))
    gaps = found(made, 0.06 * made.speed)
    _, along, _ = errors(made, gaps)
    away = gaps.column - np.mean(gaps.column)
    assert gaps.row.size >= 0.97 * (made.when.size - 2)
    assert abs(np.polyfit(away, along, 1)[0]) < 0.006 * abs(shear)


def test_depth_and_width_are_those_of_the_shutter(minute: Film) -> None:
    gaps = found(minute)
    steep = np.abs(gaps.slope) > 3.0
    assert np.mean(gaps.depth[steep]) == pytest.approx(1.0, abs=0.02)
    assert np.mean(gaps.width[steep]) == pytest.approx(WIDTH, rel=0.02)


@pytest.mark.parametrize("gap", [0.02, 0.05])
def test_the_width_is_learned(gap: float) -> None:
    made = film(20.0, gap=gap)
    assert learned_width(made.scan, made.emulsion, made.tracks) == pytest.approx(gap * made.speed, rel=0.06)


def test_a_finer_scan_finds_the_same_places() -> None:
    finer = {"speed": 118.11, "spot": 2.3622, "sizes": (188.0,), "middles": (420.0,), "columns": 840, "grain": 0.1}
    made = film(16.0, **finer)
    gaps = found(made, 2.0 * WIDTH)
    _, along, _ = errors(made, gaps)
    assert gaps.size >= made.when.size - 3
    assert np.sqrt(np.mean(along**2)) < 0.1


@pytest.mark.parametrize("grain", [0.01, 0.1])
def test_fine_and_coarse_grain_are_read(grain: float) -> None:
    made = film(20.0, grain=grain)
    gaps = found(made)
    _, along, _ = errors(made, gaps)
    assert gaps.size >= 0.9 * made.when.size
    assert np.sqrt(np.mean(along**2)) < 0.08


def test_blank_film_has_no_gaps(minute: Film) -> None:
    blank = np.full((minute.scan.rows, minute.scan.columns), round(255 * 10 ** (-FOG / SCAN_RANGE)), dtype=np.uint8)
    blank = (blank + np.random.default_rng(0).normal(0.0, 4.0, blank.shape)).astype(np.uint8)
    assert find_gaps(Pixels(blank), minute.emulsion, minute.tracks, WIDTH)[0].size == 0
    with pytest.raises(RefusedError, match="too few"):
        learned_width(Pixels(blank), minute.emulsion, minute.tracks)
    assert learned_width(Pixels(blank), minute.emulsion, minute.tracks, 1.7) == 1.7  # as was stated


def test_dust_is_not_taken_for_gaps() -> None:
    made = film(30.0, seed=2)
    rng = np.random.default_rng(1)
    image = made.scan.image.copy()
    for row, column in zip(rng.uniform(10, made.scan.rows - 10, 150), rng.uniform(100, 320, 150), strict=True):
        y, x = np.mgrid[int(row) - 6 : int(row) + 7, int(column) - 6 : int(column) + 7]
        spot = (y - row) ** 2 + (x - column) ** 2 < rng.uniform(1.0, 6.0) ** 2
        image[y[spot], x[spot]] = rng.choice([230, 73])
    gaps, _ = find_gaps(Pixels(image), made.emulsion, made.tracks, WIDTH)
    _, along, _ = errors(made, gaps)
    assert np.mean(np.abs(along) > 1.0) < 0.03
    assert np.mean(np.abs(along) < 0.3) > 0.95


def test_gaps_are_found_where_traces_cross() -> None:
    made = film(40.0, sizes=(94.0, 60.0), middles=(190.0, 240.0), periods=(1.00966, 1.0093), phases=(0.4, 1.7))
    gaps = found(made)
    for trace in range(2):
        mine = gaps.row[gaps.trace == trace]
        away = np.abs(mine[:, None] - made.row[trace][None, :]).min(axis=1)
        assert mine.size > 0.85 * made.when.size
        assert np.sqrt(np.mean(away**2)) < 0.08


def test_a_course_that_lies_early_where_it_is_far_out_is_not_taken_for_an_oblique_image(minute: Film) -> None:
    """A tracker that misjudges an oblique image draws curves as oblique; gaps stay where they are on the film."""
    tilt = 1.5e-3  # rows a column: 0.15 rows at the turning points
    rows = np.arange(minute.scan.rows) + 0.5
    course, slope = minute.tracks.course[0], minute.tracks.slope[0]
    known = np.isfinite(course)
    later = rows[known] + tilt * (course[known] - 210.0)
    curves = [np.interp(rows, later, each[known], left=np.nan, right=np.nan)[None] for each in (course, slope)]
    gaps, _ = find_gaps(minute.scan, minute.emulsion, replace(minute.tracks, course=curves[0], slope=curves[1]), WIDTH)
    which, along, _ = errors(minute, gaps)
    assert gaps.size >= 0.9 * minute.when.size
    assert abs(np.polyfit(minute.column[0][which], along, 1, w=1.0 / gaps.row_sigma)[0]) < 0.1 * tilt


def test_a_course_steeper_than_any_line_has_no_gap() -> None:
    """Walking along it in steps of a spot would take hours: such courses are drawn where there is no film."""
    courses, slopes = np.zeros((2, 1, 60))
    courses[0, 30:], slopes[0, 28:32] = 1e12, 1e12
    known = Known(1.2, 0.0, np.full(2, 0.01), 1.0, 0.1, 0.25, 30.0)
    result = fit_gaps(
        np.zeros((60, 200), np.float32), 0, courses, slopes, np.array([0]), np.array([30.0]), np.array([2.0]), known
    )
    assert np.isnan(result).all()
