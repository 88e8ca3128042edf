"""Marks counted from lists of gaps: no slip, or refused; laws of shift, scale and direction; slips put in are found."""

from __future__ import annotations

import collections
from dataclasses import replace

import numpy as np
import pytest
from mark_lists import Case, Made, made, slips

from data_schemas.errors import RefusedError
from pipeline.film.marks.axis import axis_of
from pipeline.film.marks.numbering import TimeReversedError
from pipeline.film.parts import Marking, TimeAxis

CODED = Marking(minute_code=0.125)
FILMS = 25  # of each kind
OBLIQUE = float(np.tan(np.radians(0.5)))
HARD = {
    "missing and spurious": Case(missing=0.2, spurious=20),
    "missing, wow and skew": Case(missing=0.25, wow=0.03, shear=OBLIQUE),
    "offset": Case(offset=17.7),
    "blackout": Case(blackout=((700.0, 710.0),)),
    "hidden": Case(hidden=((900.0, 920.0),)),
    "all": Case(
        missing=0.2, spurious=20, wow=0.03, drift=0.02, walk=0.005, shear=OBLIQUE, offset=17.7, hidden=((900.0, 920.0),)
    ),
    "one trace": Case(traces=1, missing=0.2, spurious=20, wow=0.02),
    "slow": Case(speed=17.72, missing=0.2, spurious=20, wow=0.03, offset=17.7),
    "blackout in a wild film": Case(
        minutes=10.0, missing=0.25, spurious=10, wow=0.03, blackout=((300.0, 310.0),), dust=20
    ),
    "hardly any": Case(missing=0.5, spurious=60, wow=0.03, walk=0.01),
    "short": Case(minutes=3.0, missing=0.2, spurious=5, wow=0.03),
}
MAY_REFUSE = {"blackout in a wild film": 0.25, "hardly any": 0.25, "all": 0.05, "short": 0.05}


def axis(truth: Made, marking: Marking = CODED) -> TimeAxis:
    return axis_of(truth.search(), truth.tracks, marking)


def verdict(truth: Made, marking: Marking = CODED) -> str:
    """Whether a film is read rightly, refused, or read wrongly: a number that slips, or a time beyond five sigma."""
    try:
        found = axis(truth, marking)
    except RefusedError:
        return "refused"
    away = slips(found.index, found.row, truth)
    known = np.isfinite(found.seconds)
    late = (found.seconds - truth.seconds)[known]
    if "marks-without-minute-code" in found.flags:  # then minutes are counted from the first mark
        away, late = away - np.median(away), late - 0.5 * np.round(2.0 * np.median(late))
    else:
        late = late - 60.0 * np.round(np.median(late) / 60.0)
    good = (away == 0.0).mean() > 0.98 and np.all(np.abs(late) < 5.0 * found.seconds_sigma[known] + 0.02)
    return "read" if good else "wrong"


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["missing, wow and skew", "offset", "blackout", "one trace"])
def test_hard_films_are_counted_rightly(name: str) -> None:
    case = replace(HARD[name], minutes=8.0, blackout=((200.0, 210.0),) if "blackout" in name else ())
    assert verdict(made(case)) == "read"


@pytest.mark.campaign
@pytest.mark.parametrize("name", HARD)
def test_no_film_is_counted_wrongly(name: str) -> None:
    seen: collections.Counter[str] = collections.Counter()
    for seed in range(FILMS):
        rng = np.random.default_rng(seed)
        case = replace(HARD[name], seed=seed, start=rng.uniform(0.0, 60.0), wow_period=rng.uniform(5.0, 20.0))
        seen[verdict(made(case))] += 1
    assert seen["wrong"] == 0
    assert seen["refused"] <= FILMS * MAY_REFUSE.get(name, 0.0)


@pytest.fixture(scope="module")
def plain() -> Made:
    return made(Case(minutes=4.0, missing=0.1, spurious=2, wow=0.01, speed=60.0))


@pytest.mark.compiled
def test_a_film_that_begins_later_has_its_rows_later(plain: Made) -> None:
    by, tracks = 137, plain.tracks
    blank = np.full((2, by), np.nan)
    moved = replace(tracks, course=np.hstack([blank, tracks.course]), slope=np.hstack([blank, tracks.slope]))
    here = axis(plain)
    there = axis(replace(plain, gaps=replace(plain.gaps, row=plain.gaps.row + by), tracks=moved))
    assert np.array_equal(here.index, there.index)
    assert np.allclose(there.row - by, here.row, atol=2e-3)
    known = np.isfinite(here.seconds)
    assert np.allclose(there.seconds[by:][known], here.seconds[known], atol=1e-4)


@pytest.mark.compiled
def test_a_finer_scan_tells_the_same_times(plain: Made) -> None:
    gaps, twice = plain.gaps, np.arange(2 * plain.tracks.course.shape[1]) / 2.0 + 0.25 - 0.5
    course = np.array([2.0 * np.interp(twice, np.arange(each.size), each) for each in plain.tracks.course])
    finer = replace(
        plain.tracks, course=course, slope=np.gradient(course, axis=1), rows_per_swing=2 * plain.tracks.rows_per_swing
    )
    fine = replace(gaps, row=2 * gaps.row, row_sigma=2 * gaps.row_sigma, column=2 * gaps.column, width=2 * gaps.width)
    here, there = axis(plain), axis(replace(plain, gaps=fine, tracks=finer, width=2 * plain.width))
    both = 0.5 * (there.seconds[0::2] + there.seconds[1::2])
    known = np.isfinite(here.seconds) & np.isfinite(both)
    assert np.allclose(both[known], here.seconds[known], atol=1e-3)


@pytest.mark.compiled
@pytest.mark.parametrize("told", [0.125, None])
def test_an_upside_down_film_is_told(told: float | None) -> None:
    with pytest.raises(TimeReversedError, match="turn the scan"):
        axis(made(Case(minutes=6.0, backwards=True, missing=0.1)), Marking(minute_code=told))


@pytest.mark.compiled
def test_the_minute_code_is_learned() -> None:
    truth = made(Case(minutes=5.0, missing=0.1, spurious=3))
    here, there = axis(truth), axis(truth, Marking())
    assert np.array_equal(here.index, there.index)
    assert np.all(slips(there.index, there.row, truth) == 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize("kind", ["long", "omitted"])
def test_other_minute_codes_are_learned(kind: str) -> None:
    truth = made(Case(minutes=8.0, code=None, unseen=0.0))
    near = np.argmin(np.abs(truth.gaps.row[:, None] - truth.row[None, :]), axis=1)
    minute = truth.number[near] % 120.0 == 0.0
    if kind == "long":
        gaps = replace(truth.gaps, width=np.where(minute, 1.6, 1.0) * truth.gaps.width)
    else:
        gaps = truth.gaps.pick(~minute)
    found = axis(replace(truth, gaps=gaps), Marking())
    assert np.all(slips(found.index, found.row, truth) == 0.0)
    assert "marks-direction-unknown" in found.flags


@pytest.mark.compiled
@pytest.mark.parametrize("code", ["long", "omitted"])
def test_stated_code_is_read_from_two_minutes(code: str) -> None:
    truth = made(Case(minutes=2.4, code=None, unseen=0.0, start=40.0))
    near = np.argmin(np.abs(truth.gaps.row[:, None] - truth.row[None, :]), axis=1)
    minute = truth.number[near] % 120.0 == 0.0
    gaps = replace(truth.gaps, width=np.where(minute, 1.6, 1.0) * truth.gaps.width)
    gaps = gaps if code == "long" else truth.gaps.pick(~minute)
    found = axis(replace(truth, gaps=gaps), Marking(code=code))
    assert np.all(slips(found.index, found.row, truth) == 0.0)
    for other in ("none", "double", {"long": "omitted", "omitted": "long"}[code]):
        assert "marks-without-minute-code" in axis(replace(truth, gaps=gaps), Marking(code=other)).flags


@pytest.mark.compiled
def test_films_without_a_code_say_so() -> None:
    truth = made(Case(minutes=4.0, code=None, missing=0.1))
    found = axis(truth)
    away = slips(found.index, found.row, truth)
    assert np.all(away == away[0])
    assert "marks-without-minute-code" in found.flags


@pytest.mark.compiled
@pytest.mark.parametrize("case", [Case(drift=0.3), Case(changes=((100.0, 110.0, 0.8),))])
def test_change_of_speed_does_not_slip(case: Case) -> None:
    truth = made(replace(case, minutes=5.0))
    found = axis(truth)
    assert np.all(slips(found.index, found.row, truth) == 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize("beside", [0.0, 1.5])  # s from the last mark to where the traces are lost
@pytest.mark.parametrize("factor", [0.8, 0.85, 1.2])
def test_unknown_number_of_marks_is_cut_or_right(factor: float, beside: float) -> None:
    lost = (100.0, 107.0 + beside)
    dark = (lost[0] - beside, lost[1] + beside)
    change = (lost[0] + 0.5, lost[1] - 0.5, factor)
    truth = made(Case(minutes=5.0, hidden=(dark,), blackout=(lost,), changes=(change,)))
    found = axis(truth)
    assert np.all(slips(found.index, found.row, truth) == 0.0)
    late = found.seconds - truth.seconds
    assert "film-cut" in found.flags or np.nanmax(np.abs(late)) < 0.2


@pytest.mark.compiled
@pytest.mark.parametrize("marks", [1, -1])
def test_a_splice_by_one_mark_is_found(plain: Made, marks: int) -> None:
    """Half a second of film cut out or put in twice: marks go on evenly, minutes and pendulums do not."""
    at, size = 7000, 30  # rows; one mark at 60 rows per second
    keep = np.arange(plain.tracks.course.shape[1])
    keep = np.delete(keep, np.arange(at, at + size)) if marks > 0 else np.insert(keep, at, np.arange(at, at + size))
    gaps = plain.gaps
    if marks > 0:
        gaps = gaps.pick((gaps.row < at) | (gaps.row >= at + size))
        gaps = replace(gaps, row=np.where(gaps.row < at, gaps.row, gaps.row - size))
    else:
        again = np.flatnonzero((gaps.row >= at) & (gaps.row < at + size))
        order = np.concatenate([np.flatnonzero(gaps.row < at + size), again, np.flatnonzero(gaps.row >= at + size)])
        later = np.arange(order.size) >= np.sum(gaps.row < at + size)
        gaps = replace(gaps.pick(order), row=gaps.row[order] + size * later)
    tracks = replace(plain.tracks, course=plain.tracks.course[:, keep], slope=plain.tracks.slope[:, keep])
    with pytest.raises(RefusedError, match="cut the film"):
        axis(replace(plain, gaps=gaps, tracks=tracks))


@pytest.mark.compiled
@pytest.mark.parametrize("marks", [1, 6])
def test_codes_out_of_step_are_refused_where_pendulums_cannot_tell(marks: int) -> None:
    """Three seconds of standing paper are six marks, and the pendulums go on almost in step."""
    truth = stood_still(made(Case(minutes=8.0, traces=1, unseen=0.0)), 450, marks)
    with pytest.raises(RefusedError, match="minute codes"):
        axis(truth)


@pytest.mark.compiled
def test_a_short_film_with_a_code_out_of_step_says_so() -> None:
    plain = made(Case(minutes=3.2, traces=1, unseen=0.0))
    assert "marks-codes-disagree" not in axis(plain).flags
    assert "marks-codes-disagree" in axis(stood_still(plain, 300, 6)).flags


def stood_still(truth: Made, mark: int, marks: int) -> Made:
    """A film whose paper stood still while so many marks were made, after one of them; its pendulums tell nothing."""
    still = replace(truth.tracks, course=np.full_like(truth.tracks.course, 500.0), slope=0.0 * truth.tracks.slope)
    cut = float(truth.row[mark]) + 10.0
    length = marks * float(np.diff(truth.row).mean())
    gaps = truth.gaps.pick((truth.gaps.row < cut) | (truth.gaps.row > cut + length))
    gaps = replace(gaps, row=np.where(gaps.row < cut, gaps.row, gaps.row - length))
    return replace(truth, gaps=gaps, tracks=still)


@pytest.mark.compiled
def test_a_wrong_speed_is_refused(plain: Made) -> None:
    with pytest.raises(RefusedError, match="rows apart"):
        axis(plain, Marking(speed=30.0))


def test_too_few_gaps_are_refused(plain: Made) -> None:
    few = plain.gaps.pick(np.arange(4))
    with pytest.raises(RefusedError, match="too few"):
        axis(replace(plain, gaps=few))


@pytest.mark.compiled
def test_sigma_of_the_seconds_is_honest() -> None:
    truth = made(Case(minutes=10.0, missing=0.2, wow=0.01, walk=0.002, seed=3))
    found = axis(truth)
    known = np.isfinite(found.seconds)
    late = (found.seconds - truth.seconds)[known]
    late -= 60.0 * np.round(np.median(late) / 60.0)
    spread = np.sqrt(np.mean((late / found.seconds_sigma[known]) ** 2))
    assert 0.5 < spread < 2.0
    assert np.sqrt(np.mean(late**2)) < 5e-4
