"""How traces are found, calibrated, followed and judged, on films small enough to run uncompiled."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from spot_film import Sheet, Swinging, developed, exposure_of
from tiny_film import CURVE, EVERY, GRAIN, LENGTH, PERIOD, SPOT, VARIANCE, Tiny, tiny

from data_schemas.errors import RefusedError
from data_schemas.variables import ELONGATION_FLAGS
from pipeline.film.emulsion import Optics, ToneCurve, plain_emulsion, shown_darkness
from pipeline.film.parts import Tracks
from pipeline.film.tracking import probing
from pipeline.film.tracking.motion import place_and_rate
from pipeline.film.tracking.outcome import fitted_gaps
from pipeline.film.tracking.pieces import Section
from pipeline.film.tracking.probing import SURE, sections
from pipeline.film.tracking.seeding import read_section
from pipeline.film.tracking.track import Following, first_section, follow_traces

ROWS, BEGIN, BLACK = 110, 15.0, 128.0
FIRST_ROWS = round(8.0 * PERIOD)  # a section, on films that are shorter than usual ones


@pytest.fixture(scope="module")
def short() -> Tiny:
    """Two traces behind a blank margin."""
    return tiny(ROWS, ((BEGIN, 200.0),))


@pytest.fixture(scope="module")
def section(short: Tiny) -> Section:
    found = read_section(short.film.darkness(0, ROWS), 0, short.optics, PERIOD, 2, least=SURE)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def dark() -> tuple[Tiny, Tracks]:
    """Two traces with a blackout, tracked."""
    made = tiny(230, ((BEGIN, 90.0), (BLACK, 215.0)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(probing, "FIRST_ROWS", FIRST_ROWS)
        return made, follow_traces(made.sheet, made.emulsion, count=2).checked()


def test_a_section_shows_its_traces(short: Tiny, section: Section) -> None:
    for swing, trace in zip(section.swings, short.traces, strict=True):
        assert swing.amplitude == pytest.approx(trace.amplitude, rel=0.03)
        assert swing.state[0] == pytest.approx(trace.middle, abs=2.0)
    assert section.period == pytest.approx(PERIOD, rel=0.02)
    away = short.across(section.place)[:, int(BEGIN) + 4 :]
    assert np.nanmedian(np.abs(away)) < 0.06  # beside gaps single readings lie farther off
    assert np.isfinite(away).mean() > 0.75


@pytest.mark.compiled
@pytest.mark.parametrize("hidden", [2, 3])
def test_traces_are_found_that_turn_under_lines_across(hidden: int) -> None:
    """What is hidden shows neither turns nor that a trace is lost."""
    turning, rows, period = [Swinging(110.0, 60.0, 0.1), Swinging(290.0, 55.0, 0.3)], 300, 31.3
    sheet = Sheet(developed(exposure_of(turning, rows, 400), grain=GRAIN))
    darkness = shown_darkness(plain_emulsion(sheet), sheet, 0, rows, np.nan)
    for row in np.arange(-0.5, rows, 0.5 * period).astype(int):
        darkness[max(row - hidden, 0) : row + hidden + 1] = np.nan
    found = read_section(darkness, 0, Optics(1.2, 0.0, CURVE, VARIANCE), period, 2, least=SURE)
    assert found is not None
    assert [swing.amplitude for swing in found.swings] == pytest.approx([60.0, 55.0], rel=0.03)
    assert found.share.min() > 0.9


def test_spot_and_curve_are_told_from_a_section(short: Tiny, section: Section, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probing, "MOST_ROWS", 25)
    wrong = replace(short.optics, spot=1.1 * SPOT, curve=ToneCurve(CURVE.darkest * 1.1, CURVE.middle * 1.2, 1.4))
    told = probing.calibrate(section, wrong)
    assert told.spot == pytest.approx(SPOT, rel=0.05)
    light = np.linspace(0.1, 0.9, 9)
    assert told.curve.darkness(light) == pytest.approx(CURVE.darkness(light), rel=0.06)


def test_a_first_guess_of_the_optics_is_refined(short: Tiny, section: Section, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probing, "MOST_ROWS", 25)
    monkeypatch.setattr(probing, "REFINEMENTS", 1)
    guess = probing.first_optics(section.darkness, float(np.sqrt(short.optics.grain[0])))
    assert guess.spot == pytest.approx(SPOT, rel=0.3)
    again = probing.refine(replace(section, optics=guess), fixed=False)
    told = again.optics
    assert abs(told.spot / SPOT - 1.0) < 0.08
    assert abs(told.shear) < 0.005
    assert [swing.amplitude for swing in again.swings] == pytest.approx([t.amplitude for t in short.traces], rel=0.03)


def test_traces_are_followed_from_the_films_start() -> None:
    made = tiny(150, ((0.0, 150.0),))
    late = read_section(made.film.darkness(100, 150), 100, made.optics, PERIOD, 2, least=SURE)
    assert late is not None
    early = first_section(made.film, late)
    assert early.first < 40
    rows = early.first + np.arange(early.states.shape[0]) + 0.5
    course = early.states[:, :, 0] + early.states[:, :, 3]
    true = np.stack([trace.column(rows) for trace in made.traces], axis=1)
    assert np.median(np.abs(course - true)) < 0.2


def test_too_short_a_section_tells_nothing(short: Tiny, section: Section) -> None:
    dim = replace(section, place=np.full_like(section.place, np.nan))
    given = short.optics
    assert probing.calibrate(dim, given) is given
    assert probing.measure_shear(dim) == 0.0


@pytest.mark.parametrize("shear", [0.0, 0.02, -0.02])
def test_the_slit_s_lean_shows_in_the_second_harmonic(short: Tiny, section: Section, shear: float) -> None:
    rows, along = np.arange(ROWS) + 0.5, np.arange(-20.0, ROWS + 20.0, 0.01)
    leaning = np.stack([np.interp(rows, along + shear * t.column(along), t.column(along)) for t in short.traces])
    read = replace(section, place=np.where(np.isfinite(section.place), leaning, np.nan))
    # told in steps: each must take most of what is left away
    assert probing.measure_shear(read) == pytest.approx(shear, rel=0.4, abs=0.002)


def test_a_chance_reading_on_blank_film_does_not_lose_the_trace(short: Tiny, section: Section) -> None:
    place = section.place.copy()
    place[:, :18] = np.nan
    place[0, 3] = section.states[3, 0, 0]  # the grain looked like a line for a row
    following = Following.of(short.film, replace(section, place=place))
    lit = np.arange(ROWS) > BEGIN + 0.5 * PERIOD
    assert np.all(following.followed[:, lit] > 0)


def test_gaps_are_fitted_to_a_tenth_of_a_row(short: Tiny, section: Section) -> None:
    true = np.arange(5.0, ROWS, EVERY)
    true = true[(true > BEGIN + 10) & (true < ROWS - 10)]
    gaps = true[:, None] + 0.4 + 0.5 * LENGTH * np.array([-1.0, 1.0])
    place = (section.states[:, :, 0] + section.states[:, :, 3]).T
    slope = (section.states[:, :, 1] - section.states[:, :, 5] * section.states[:, :, 4]).T
    for fitted in fitted_gaps(section.darkness, 0, place, slope, [gaps, gaps], short.emulsion, PERIOD):
        assert np.abs(fitted.mean(axis=1) - true).mean() < 0.1
        assert np.mean(fitted[:, 1] - fitted[:, 0]) == pytest.approx(LENGTH, rel=0.1)


def test_a_film_with_a_blackout_is_read_on_both_sides(dark: tuple[Tiny, Tracks]) -> None:
    made, tracks = dark
    read = np.isfinite(tracks.position)
    assert read[:, made.lit].mean() > 0.7
    assert not read[:, ~made.lit].any()
    assert np.nanmax(np.abs(made.across(tracks.position))) < 1.0
    lost = (tracks.qc & ELONGATION_FLAGS["lost"]) > 0
    assert lost[:, 100:118].all()
    assert np.isnan(tracks.course[:, 100:118]).all()
    assert tracks.rows_per_swing == pytest.approx(PERIOD, rel=0.01)


def test_several_threads_read_what_one_reads(dark: tuple[Tiny, Tracks], monkeypatch: pytest.MonkeyPatch) -> None:
    made, tracks = dark
    monkeypatch.setattr(probing, "FIRST_ROWS", FIRST_ROWS)
    again = follow_traces(made.sheet, made.emulsion, count=2, jobs=2).checked()
    for field in fields(Tracks):  # sums over arrays may end in other last digits where these lie elsewhere in memory
        same = {"rtol": 1e-9, "atol": 1e-9, "err_msg": field.name}
        np.testing.assert_allclose(getattr(again, field.name), getattr(tracks, field.name), **same)


def test_readings_are_good_and_gaps_are_flagged(dark: tuple[Tiny, Tracks]) -> None:
    made, tracks = dark
    assert np.sqrt(np.nanmean(made.across(tracks.position) ** 2)) < 0.06  # the bar is 0.20
    middles = np.arange(5.0, 230.0, EVERY)
    for middle in middles[1:-1]:
        if made.lit[int(middle) - 9 : int(middle) + 10].all():
            assert np.all(tracks.qc[:, int(middle)] & ELONGATION_FLAGS["gap"])
            assert not np.isfinite(tracks.position[:, int(middle)]).any()


def test_names_go_where_the_user_says(dark: tuple[Tiny, Tracks]) -> None:
    _, tracks = dark
    assert np.nanmean(tracks.course[0]) < np.nanmean(tracks.course[1])


def test_grain_alone_is_refused() -> None:
    blank = tiny(56, ())
    with pytest.raises(RefusedError, match="no swinging trace"):
        follow_traces(blank.sheet, blank.emulsion)


@pytest.mark.parametrize("rows", [40, 500, 5000])
def test_sections_lie_on_the_film_and_apart(rows: int) -> None:
    looked = list(sections(rows, 300))
    assert all(0 <= first < stop <= rows for first, stop in looked)
    firsts = sorted(first for first, _ in looked)
    assert all(b - a >= 150 for a, b in pairwise(firsts))


def test_a_section_whose_turning_points_lie_in_gaps_is_worth_little(section: Section) -> None:
    slope = np.abs(place_and_rate(section.states)[1].T)
    hidden = slope < 0.5 * slope.max(axis=1)[:, None]
    gapped = replace(section, place=np.where(hidden, np.nan, section.place))
    assert probing._worth(gapped)[1] < 0.1 * probing._worth(section)[1]


@pytest.mark.parametrize(
    ("count", "worth", "looks", "swings"), [(None, 10_000, 3, 1), (None, 100, 7, 1), (2, 10_000, 9, 2)]
)
def test_sections_are_looked_at_until_one_shows_all_traces_and_their_turning_points(
    short: Tiny,
    section: Section,
    monkeypatch: pytest.MonkeyPatch,
    count: int | None,
    worth: int,
    looks: int,
    swings: int,
) -> None:
    """Of two traces that lie on each other nearly everywhere, one wrong one is found nearly everywhere."""
    alone = replace(section, swings=section.swings[:1])
    looked: list[int] = []

    def read(_piece: object, first: int, *_others: object) -> Section:
        looked.append(first)
        return section if len(looked) == 9 else alone

    monkeypatch.setattr(probing, "_read_askew", read)
    monkeypatch.setattr(probing, "_worth", lambda _section: (40, worth))
    monkeypatch.setattr(probing, "refine", lambda section, fixed: section)
    monkeypatch.setattr(probing, "read_section", lambda *_args, **_options: None)
    monkeypatch.setattr(probing, "shown_darkness", lambda *_: section.darkness)
    found = probing.probe(SimpleNamespace(rows=20_000), short.emulsion, count)
    assert found is not None
    assert (len(looked), len(found.swings)) == (looks, swings)
