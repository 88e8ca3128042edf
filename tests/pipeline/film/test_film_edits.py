"""A person's edits: what they change, what they leave to the last bit, and that they can be replayed."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import data_schemas
from data_schemas.checksum import numbers_sha256
from data_schemas.errors import RecordError, UsageError
from data_schemas.film_edits import FilmEdits, edits_path, load_edits
from pipeline.cli.main import main
from pipeline.film.digitise import digitise, make_record, open_film
from pipeline.film.edits import Placed, contains
from pipeline.film.following import FilmTraces, find_time
from pipeline.film.knowledge import FilmOptions
from pipeline.film.reading import read_traces

tifffile = pytest.importorskip("tifffile")
pytestmark = pytest.mark.compiled


@pytest.fixture(scope="module")
def opened(path):
    scan, known = open_film(path, None, FilmOptions())
    return find_time(scan, known)[0], known


@pytest.fixture
def run(capsys):
    def call(*words: object) -> SimpleNamespace:
        status = main([str(word) for word in words])
        out, err = capsys.readouterr()
        return SimpleNamespace(status=status, out=out, err=err)

    return call


def edited(opened: tuple[FilmTraces, object], *edits: dict):
    traces, known = opened
    made = FilmEdits.model_validate({"sha256": traces.scan.sha256, "edits": edits})
    traces = traces.edited(made, known)
    return read_traces(traces, traces.axis(known), known)


@pytest.fixture(scope="module")
def plain(opened):
    traces, known = opened
    return read_traces(traces, traces.axis(known), known)


def test_a_mask_where_nothing_lies_changes_nothing(opened, plain):
    found = edited(opened, {"kind": "mask", "points": [[3000.0, 2.0], [3300.0, 20.0]]})
    for name in ("position", "sigma", "course", "qc"):
        np.testing.assert_array_equal(getattr(found.tracks, name), getattr(plain.tracks, name))
    np.testing.assert_array_equal(found.axis.seconds, plain.axis.seconds)
    assert numbers_sha256(make_record(found, opened[1], "a")) != ""
    np.testing.assert_array_equal(found.samples.column, plain.samples.column)


def test_nothing_is_read_in_a_mask_and_all_is_beside_it(opened, plain):
    corners = [[3000.0, 100.0], [3000.0, 1490.0], [3200.0, 1490.0], [3200.0, 100.0]]
    found = edited(opened, {"kind": "mask", "points": corners})
    rows = np.arange(plain.tracks.course.shape[1]) + 0.5
    inside = (rows > 3000.0) & (rows < 3200.0)
    assert not np.isfinite(found.tracks.position[:, inside]).any()
    far = (rows < 2900.0) | (rows > 3300.0)
    both = np.isfinite(found.tracks.position) & np.isfinite(plain.tracks.position)
    assert both[:, far].sum() > 0.99 * np.isfinite(plain.tracks.position[:, far]).sum()
    away = (found.tracks.position - plain.tracks.position) / plain.tracks.sigma
    assert np.quantile(np.abs(away[both]), 0.999) < 0.5
    assert np.abs(away[both]).max() < 4.0  # of one row the fit may weigh another pixel less
    times = np.abs(found.axis.seconds - plain.axis.seconds)
    assert np.nanmax(times[far]) < 1e-3
    assert np.nanmax(times / np.hypot(found.axis.seconds_sigma, plain.axis.seconds_sigma)) < 4.0


def test_ink_is_masked_away(path, opened, plain, tmp_path):
    image = tifffile.imread(path)
    clean, tracks = np.array(image), plain.tracks
    image[4000:4060, 300:900] = 5  # a blot over the first trace
    blotted = tmp_path / "ink.film.tif"
    tifffile.imwrite(blotted, image, resolution=(300, 300), resolutionunit="INCH")
    blotted.with_name("ink.film.toml").write_text(path.with_name("night.film.toml").read_text())
    scan, known = open_film(blotted, None, FilmOptions())
    found = edited((find_time(scan, known)[0], known), {"kind": "mask", "points": [[3995.0, 295.0], [4065.0, 905.0]]})
    assert clean.shape == image.shape
    rows = np.arange(tracks.course.shape[1]) + 0.5
    beside = np.abs(rows - 4030.0) < 400.0
    both = np.isfinite(found.tracks.position) & np.isfinite(tracks.position) & beside
    away = np.abs(found.tracks.position - tracks.position)[both] / tracks.sigma[both]
    assert np.quantile(away, 0.97) < 1.0  # ink changes what is measured of the whole film, gaps' edges feel it
    hidden = (np.abs(rows - 4030.0) < 30.0) & (np.abs(tracks.course[0] - 600.0) < 290.0)
    assert not np.isfinite(found.tracks.position[0, hidden]).any()


def test_a_line_that_a_trace_follows_anyway_moves_nothing_by_a_tenth_of_sigma(opened, plain):
    rows = np.arange(2500.0, 2680.0, 7.0)
    columns = np.interp(rows, np.arange(plain.tracks.course.shape[1]) + 0.5, plain.tracks.course[1])
    found = edited(opened, {"kind": "follow", "trace": 2, "points": np.column_stack([rows, columns]).tolist()})
    both = np.isfinite(found.tracks.position) & np.isfinite(plain.tracks.position)
    assert both.sum() > 0.999 * np.isfinite(plain.tracks.position).sum()
    assert np.nanmax(np.abs(found.tracks.position - plain.tracks.position)[both] / plain.tracks.sigma[both]) < 0.1


def test_a_line_where_no_trace_runs_makes_up_no_readings(opened, plain):
    rows = np.arange(2500.0, 2680.0, 7.0)
    columns = np.interp(rows, np.arange(plain.tracks.course.shape[1]) + 0.5, plain.tracks.course[1]) + 60.0
    found = edited(opened, {"kind": "follow", "trace": 2, "points": np.column_stack([rows, columns]).tolist()})
    both = np.isfinite(found.tracks.position) & np.isfinite(plain.tracks.position)
    assert np.abs(found.tracks.position - plain.tracks.position)[both].max() < 1.0
    made_up = np.isfinite(found.tracks.position[1]) & ~np.isfinite(plain.tracks.position[1])
    assert made_up[2520:2620].mean() < 0.2


def test_a_mark_taken_away_and_set_again(opened, plain):
    row = float(plain.axis.row_of_trace[0, 100])
    without = edited(opened, {"kind": "no-mark", "row": row})
    assert plain.axis.index[100] not in without.axis.index
    again = edited(opened, {"kind": "no-mark", "row": row}, {"kind": "mark", "row": row + 0.5})
    assert plain.axis.index[100] in again.axis.index
    for found in (without, again):
        assert np.nanmax(np.abs(found.axis.seconds - plain.axis.seconds)) < 3e-3


def test_a_clock_time_counts_all_marks(opened, plain):
    at, row = int(plain.axis.index[60]), float(plain.axis.row_of_trace[0, 60])
    named = edited(opened, {"kind": "mark", "row": row, "time": "00:07:30.5"})
    moved = named.axis.seconds - plain.axis.seconds
    assert np.nanmax(np.abs(moved - (450.5 - at * plain.axis.interval))) < 1e-9
    # the film's own minutes say otherwise
    assert ("marks-codes-disagree" in named.axis.flags) == bool((450.5 - at * plain.axis.interval) % 60.0)


@pytest.mark.parametrize(
    ("edits", "words"),
    [
        ([{"kind": "mark", "row": 900.0, "trace": 3}], "edits[0]: there is no trace 3; the film shows 2"),
        ([{"kind": "mask", "points": [[0.0, 0.0], [9e6, 5.0]]}], "edits[0]: row 9e+06, column 5 lies outside"),
        ([{"kind": "mark", "row": -4.0}], "edits[0]: row -4, column 0 lies outside"),
    ],
)
def test_what_cannot_be_meant_is_one_line(opened, edits, words):
    with pytest.raises(RecordError) as told:
        edited(opened, *edits)
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_times_that_contradict_each_other(opened, plain):
    one, other = plain.axis.row_of_trace[0, [40, 80]].tolist()
    marks = [{"kind": "mark", "row": one, "time": "00:01:00"}, {"kind": "mark", "row": other, "time": "00:03:00"}]
    with pytest.raises(RecordError, match="marks lie between the marks at rows"):
        edited(opened, *marks)
    with pytest.raises(RecordError, match="no whole number of mark intervals"):
        edited(opened, {"kind": "mark", "row": one, "time": "00:01:00.2"})


def test_a_break_cuts_unless_times_join_it(opened, plain):
    axis, between = plain.axis, float(plain.axis.row[100] + 20.0)
    cut = edited(opened, {"kind": "break", "row": between})
    assert "film-cut" in cut.axis.flags
    assert np.isfinite(cut.axis.seconds).sum() < 0.9 * np.isfinite(axis.seconds).sum()
    ends = [(axis.row_of_trace[0, k], axis.index[k] * axis.interval) for k in (30, 150)]
    named = [{"kind": "mark", "row": row, "time": f"00:{int(t) // 60:02d}:{t % 60:04.1f}"} for row, t in ends]
    joined = edited(opened, {"kind": "break", "row": between}, *named)
    assert "film-cut" not in joined.axis.flags
    both = np.isfinite(joined.axis.seconds) & np.isfinite(axis.seconds)
    assert np.abs(joined.axis.seconds - axis.seconds)[both].max() < 1e-3


def test_a_trace_is_ignored_on_some_rows_or_as_a_whole(opened, plain):
    some = edited(opened, {"kind": "ignore", "trace": 2, "first_row": 3000.0, "last_row": 3500.0})
    assert not np.isfinite(some.tracks.position[1, 3000:3500]).any()
    np.testing.assert_array_equal(some.tracks.position[0], plain.tracks.position[0])
    whole = make_record(edited(opened, {"kind": "ignore", "trace": 2}), opened[1], "a")
    assert whole["record"]["trace"].values.tolist() == ["1"]


def test_edits_are_replayed_to_the_same_numbers(path, opened, run, tmp_path):
    edits = FilmEdits.model_validate(
        {
            "sha256": opened[0].scan.sha256,
            "edits": [
                {"kind": "mask", "points": [[3000.0, 100.0], [3200.0, 900.0]], "by": "A. B.", "at": "2026-11-26"},
                {"kind": "no-mark", "row": 800.0},
                {"kind": "mask", "points": [[3150.0, 300.0], [3400.0, 700.0]]},
            ],
        }
    )
    edits.save(edits_path(path))
    assert load_edits(edits_path(path)) == edits
    assert data_schemas.validate(edits_path(path)) == []
    record = digitise(path, edits=edits)
    assert load_edits_text(record.children["film"].attrs["edits"], tmp_path) == edits
    outcome = run("digitise", path, "--edits", "-o", tmp_path / "again.record.nc", "--jobs", "2")
    assert outcome.status == 0, outcome.err
    assert numbers_sha256(data_schemas.read(tmp_path / "again.record.nc")) == numbers_sha256(record)
    other = FilmEdits(sha256=("0" * 64,), edits=edits.edits)
    with pytest.raises(RecordError, match="made for another scan"):
        digitise(path, edits=other)


def load_edits_text(text: str, folder) -> FilmEdits:
    (folder / "replayed.edits.toml").write_text(text)
    return load_edits(folder / "replayed.edits.toml")


def test_a_part_of_the_film_by_time_or_by_row(path, run, tmp_path):
    out = tmp_path / "part.record.nc"
    outcome = run("digitise", path, "--from", "30", "--to", "90.5", "-o", out)
    assert outcome.status == 0, outcome.err
    time = data_schemas.read(out).dataset["time"].values
    assert 30.0 <= time[0] < 30.1
    assert 90.4 < time[-1] <= 90.5
    outcome = run("digitise", path, "--from", "1500px", "--to", "6000px", "-o", out, "--force")
    assert outcome.status == 0, outcome.err
    assert np.ptp(data_schemas.read(out).dataset["time"].values) == pytest.approx(4500 / 59.06, abs=1.5)
    assert "rows 1500 to 6000 of" in outcome.err
    for wrong, words in (
        (("--from", "soon"), "--from wants seconds, or a row as 1200px, not 'soon'"),
        (("--from", "90", "--to", "30"), "--to 30 is not after --from 90"),
        (("--from", "9000"), "nothing was read from 9000"),
        (("--from", "900000px"), "the film has rows 0 to"),
    ):
        outcome = run("digitise", path, *wrong, "-o", out, "--force")
        assert outcome.status == 2
        assert words in outcome.err
        assert outcome.err.count("\n") == 1
    with pytest.raises(UsageError, match="edits count on the whole film"):
        digitise(path, edits=FilmEdits(sha256=("0" * 64,)), rows=(0, 5000))


def test_places_in_a_polygon():
    corners = np.array([[0.0, 0.0], [0.0, 10.0], [10.0, 10.0], [4.0, 5.0], [10.0, 0.0]])
    rows, columns = np.array([2.0, 8.0, 8.0, -1.0]), np.array([5.0, 5.0, 9.0, 5.0])
    assert contains(corners, rows, columns).tolist() == [True, False, True, False]

    def hidden(mask: np.ndarray) -> int:
        return int(np.isnan(Placed(masks=[mask]).hide(np.zeros((20, 20), dtype=np.float32), 95)).sum())

    assert hidden(corners + np.array([100.0, 3.0])) == pytest.approx(70.0, abs=3.0)
    assert hidden(np.array([[97.0, 4.0], [99.0, 8.0]])) == 8
    assert hidden(np.array([[40.0, 4.0], [60.0, 8.0]])) == 0
