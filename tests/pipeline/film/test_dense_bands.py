"""Dense bands of slow films before anything is fitted: bands, swings, first curves, and blocks brought together."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from spot_film import SPOT, Sheet, Swinging, exposure_of

from data_schemas.errors import RefusedError
from pipeline.film.following import ways_to_follow
from pipeline.film.marks import gap_kernels
from pipeline.film.marks import survey as band_survey
from pipeline.film.marks.alignment import Gaps
from pipeline.film.marks.dense import blended, joined, unlike, usual_swing
from pipeline.film.marks.dense_kernels import CUBIC, SIZE, first_shapes, values
from pipeline.film.marks.strobe import AT_TURNS, BEND, UNKNOWN_BEND, bends
from pipeline.film.marks.survey import Saturated, Survey, bands, light_of, saturation, survey
from pipeline.film.parts import Tracks

PERIOD, LEAST = 17.9, 0.002
LEFT = Swinging(100.0, 45.0, 0.3, PERIOD, slow=40.0, slow_period=150.0)  # swell of the swing's own size
RIGHT = Swinging(290.0, 60.0, 2.0, PERIOD)


class Lit:
    """A film that is its own exposure, with little noise."""

    def exposure(self, pixels: NDArray[np.float32], first: int) -> NDArray[np.float32]:
        return pixels

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.maximum(0.001, exposure**2).astype(np.float32)


@cache
def light() -> NDArray[np.float32]:
    rows = 160
    gaps = np.arange(4.0, rows, 8.86)[:, None] + np.array([-0.26, 0.26])
    return exposure_of([LEFT, RIGHT], rows, 370, gaps).astype(np.float32)


def test_every_row_is_lit_alike_and_in_the_middle_of_its_trace() -> None:
    slow = Swinging(290.0, 40.0, 2.0, 29.3)  # turning points that are no brighter than what counts
    brightness, column = light_of(0.1 * exposure_of([slow], 80, 370).astype(np.float32), 180, 370, 0.0)
    inside = slice(10, 70)
    row = np.arange(80)[inside] + 0.5
    blurred = 290.0 + np.exp(-0.5 * (2 * np.pi / 29.3 * SPOT) ** 2) * (slow.column(row) - 290.0)
    np.testing.assert_allclose(column[inside], blurred, atol=0.05)
    assert brightness[inside].max() < 1.001 * brightness[inside].min()


@pytest.mark.parametrize(("trace", "columns"), [(LEFT, (0, 200)), (RIGHT, (200, 370))])
def test_first_curves_follow_a_swell_as_large_as_the_swing(trace: Swinging, columns: tuple[int, int]) -> None:
    brightness, column = light_of(light(), *columns, LEAST)
    middles = np.arange(25.0, 135.0, PERIOD)
    shapes = first_shapes(brightness, column, 0, middles, PERIOD, SPOT)
    for shape, middle in zip(shapes, middles, strict=True):
        away = np.linspace(-0.6, 0.6, 41) * PERIOD
        across = (values(shape, away, PERIOD)[0] - trace.column(middle + away)) / np.hypot(
            1.0, trace.slope(middle + away)
        )
        assert np.median(np.abs(across)) < 0.5 * SPOT


def test_a_block_in_the_dark_has_no_curve() -> None:
    dark = light().copy()
    dark[60:110] = 0.0
    shapes = first_shapes(*light_of(dark, 0, 200, LEAST), 0, np.array([30.0, 85.0]), PERIOD, SPOT)
    assert np.isfinite(shapes[0]).all()
    assert np.isnan(shapes[1]).all()


def test_the_survey_finds_bands_and_period() -> None:
    found = survey(Sheet(light()), Lit(), 2)
    assert found.period == pytest.approx(PERIOD, rel=0.02)
    for (left, right), trace in zip(found.bands, (LEFT, RIGHT), strict=True):
        reach = trace.amplitude + trace.slow
        assert trace.middle - reach - 6 <= left < trace.middle - 0.6 * trace.amplitude
        assert trace.middle + 0.6 * trace.amplitude < right <= trace.middle + reach + 6


@pytest.mark.parametrize(("count", "what"), [(3, "2 swinging bands found, 3 expected"), (2, "bands found")])
def test_other_bands_than_expected_are_refused(count: int, what: str) -> None:
    image = light() if count == 3 else np.zeros_like(light())
    with pytest.raises(RefusedError, match=what):
        survey(Sheet(image), Lit(), count)


@pytest.mark.parametrize("periods", [[17.9, 35.8, 18.0, 17.8, 9.0], [9.0, 17.9, 26.0, 35.0, 44.0]])
def test_sections_vote_for_the_period(monkeypatch: pytest.MonkeyPatch, periods: list[float]) -> None:
    told = iter(periods)
    monkeypatch.setattr(band_survey, "PLACES", len(periods))
    monkeypatch.setattr(band_survey, "SWINGS", 4)
    monkeypatch.setattr(band_survey, "rows_per_swing", lambda *_: next(told))
    if periods[0] == 17.9:
        assert survey(Sheet(light()), Lit(), 2).period == 17.9
        return
    with pytest.raises(RefusedError, match="sections disagree on the rows in a swing"):
        survey(Sheet(light()), Lit(), 2)


def test_the_brightest_bands_are_kept_from_left_to_right() -> None:
    lit = np.zeros((20, 200), dtype=bool)
    lit[:, 20:60], lit[::2, 90:130], lit[:, 150:153] = True, True, True  # the last is too narrow for a swing
    assert [round(left, -1) for left, _ in bands(lit, None)] == [20, 90]
    assert [round(left, -1) for left, _ in bands(lit, 1)] == [20]
    assert bands(np.zeros_like(lit), None) == []


def test_windows_end_half_way_to_the_next_band() -> None:
    found = Survey(((100, 200), (220, 320)), PERIOD)
    assert found.windows(330) == [(50, 210), (210, 330)]


def test_values_are_linear_and_each_others_derivatives() -> None:
    shape = np.random.default_rng(3).normal(size=SIZE)
    away = np.linspace(-15.0, 15.0, 31)
    column, slope, curvature = values(shape, away, PERIOD)
    basis = values(np.eye(SIZE)[:, None], away, PERIOD)[0]
    np.testing.assert_allclose(column, shape @ basis, rtol=1e-12, atol=1e-12)
    ahead, behind = values(shape, away + 1e-4, PERIOD), values(shape, away - 1e-4, PERIOD)
    np.testing.assert_allclose(slope, (ahead[0] - behind[0]) / 2e-4, atol=1e-6)
    np.testing.assert_allclose(curvature, (ahead[1] - behind[1]) / 2e-4, atol=1e-6)


def chain(blocks: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Blocks of one steady swing."""
    shape = np.zeros((blocks, SIZE))
    shape[:, 0], shape[:, CUBIC] = 50.0, 30.0
    return (np.arange(blocks) + 1.0) * PERIOD, shape


def test_a_block_beside_its_neighbours_is_left_out() -> None:
    middle, shape = chain(6)
    shape[3, 0] += 80.0
    kept = joined(shape, np.ones(6), PERIOD, SPOT)
    np.testing.assert_array_equal(kept, [1, 1, 1, 0, 1, 1])
    course = blended(middle, shape, kept, PERIOD, int(7 * PERIOD))[0]
    row = np.arange(course.size) + 0.5
    np.testing.assert_allclose(course, 50.0 + 30.0 * np.cos(2 * np.pi * row / PERIOD), atol=1e-9)


def test_a_blended_curve_is_smooth() -> None:
    middle, shape = chain(4)
    shape[:, 0] += [0.0, 1.0, 0.0, -1.0]
    course, slope, curvature, lit = blended(middle, shape, np.array([1.0, 1.0, 0.5, 1.0]), PERIOD, 80)
    np.testing.assert_allclose(slope[2:-2], np.gradient(course)[2:-2], atol=0.3)
    np.testing.assert_allclose(curvature[2:-2], np.gradient(slope)[2:-2], atol=0.3)
    assert lit.min() == pytest.approx(0.5, abs=0.02)
    assert np.isnan(blended(middle, shape, np.zeros(4), PERIOD, 90)[0]).all()


def test_a_swing_that_is_not_its_neighbours_is_found() -> None:
    _, shape = chain(9)
    shape[:, CUBIC] += np.linspace(0.0, 2.0, 9)
    shape[4, CUBIC] *= -1.0
    usual = usual_swing(shape, np.ones(9, dtype=bool))
    np.testing.assert_array_equal(np.flatnonzero(unlike(shape, usual)), [4])
    assert np.isnan(usual_swing(shape, np.zeros(9, dtype=bool))).all()


def strokes(away: float, by_rows: bool) -> tuple[Tracks, Gaps]:
    """A steep course, and gaps that lie beside it by `away` px to either side."""
    row = np.arange(200) + 0.5
    course, slope = 300.0 + 20.0 * row, np.full(200, 20.0)
    one = np.full((1, 200), 1.0 if by_rows else np.nan)
    tracks = Tracks(
        one, one, course[None], slope[None], 0 * slope[None], one, np.zeros((1, 200), np.uint16), PERIOD, SPOT
    )
    at = np.linspace(10.0, 190.0, 30)
    fitted = np.zeros((30, gap_kernels.RESULTS))
    fitted[:, gap_kernels.ROW], fitted[:, gap_kernels.SLOPE] = at, 20.0
    fitted[:, gap_kernels.COLUMN] = 300.0 + 20.0 * at + away * np.where(np.arange(30) % 2, 1.0, -1.0)
    return tracks, Gaps.of(np.zeros(30, dtype=np.int64), fitted)


def test_what_a_dense_course_may_err_by_in_turning_points_is_told_on_its_strokes() -> None:
    assert bends(*strokes(2.0, False)) == pytest.approx([2.0 * 1.4826 * AT_TURNS], rel=1e-6)
    assert bends(*strokes(0.0, False)) == pytest.approx([BEND])
    assert bends(*strokes(2.0, True)) == pytest.approx([BEND])  # read in rows, too
    tracks, gaps = strokes(2.0, False)
    assert bends(tracks, gaps.pick(np.arange(3))) == pytest.approx([UNKNOWN_BEND])


def test_saturation_is_where_the_grain_hides_the_exposure() -> None:
    assert saturation(Lit()) == pytest.approx(0.3, abs=0.03)
    film = Saturated(Lit())
    np.testing.assert_allclose(
        film.exposure(np.array([[0.1, 0.5, 3.0]], dtype=np.float32), 0), [[0.1, 0.5, 1.0]], atol=0.03
    )
    noise = film.noise(np.array([0.1, 0.5], dtype=np.float32))
    assert noise[0] == pytest.approx(0.01)
    assert noise[1] > 100.0


def test_only_slow_films_are_followed_as_bands() -> None:
    assert ways_to_follow("strobe", 17.7) == (True, False)
    assert ways_to_follow("auto", None) == (False, True)
    assert ways_to_follow("continuous", None) == (False,)
    assert ways_to_follow("strobe", 30.0) == (False,)
