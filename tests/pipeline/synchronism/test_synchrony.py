"""Verdicts on records made with a known state; slips, rates, lock time, beam, Allan deviation as put in."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from known_clocks import NAMED, STATES, adler, made, record_of, swings

import data_schemas
import pipeline
from data_schemas.errors import RecordError, RefusedError
from pipeline.synchronism import verdict
from pipeline.synchronism.recipe import pendulums_of
from pipeline.synchronism.verdict import judge, slip_times


def found(record):
    result = pipeline.synchrony(record)
    assert data_schemas.check(result, "result") == []
    return result["synchrony"].dataset


def wrong(seed: int) -> str:
    """What the verdict on one record has wrong, or nothing."""
    state = STATES[seed % len(STATES)]
    record, angle = made(state, seed)
    table = found(record).isel(pair=0)
    said, sure = str(table["verdict"].values), float(table["confidence"])
    told = f"{seed}: {state}, said {said} ({sure:.3f}), slips {int(table['slips'])}"
    if said != state or sure < 0.5:
        return told
    apart = np.angle(np.exp(1j * (float(table["locked_angle"]) - angle)))
    return f"{told}: angle off by {apart:.3f}" if state in (*NAMED, "other angle") and abs(apart) > 0.02 else ""


@pytest.mark.parametrize("seed", range(20))
def test_the_verdict_is_right(seed: int) -> None:
    assert not wrong(seed)


@pytest.mark.campaign
def test_the_verdict_is_right_on_all_of_200() -> None:
    assert [told for told in map(wrong, range(1000, 1200)) if told] == []


def test_slips_are_counted_and_dated() -> None:
    time = np.arange(0.0, 600.0, 0.1)
    psi = adler(time, 1.05, 5, -1.0)
    table = found(record_of(time + 50.0, swings(time, psi, np.random.default_rng(3), 1e-4)))
    expected = slip_times(time, psi - psi[30])
    assert len(expected) == int(table["slips"][0]) == 5
    assert np.abs(table["slip_time"].values - 50.0 - np.array(expected)).max() < 4.0
    assert str(table["slip_pair"].values[0]) == "1-2"


def test_the_rate_difference_is_in_swings_a_day() -> None:
    """psi' = 2 pi/86400 x 25: the first makes 25 swings a day more; scatter and sigma agree."""
    time = np.arange(0.0, 900.0, 0.1)
    chance = np.random.default_rng(5)
    table = found(record_of(time, swings(time, 2.0 * np.pi * 25.0 / 86400.0 * time, chance, 1e-3)))
    apart = float(table["mean_rate_difference"][0]) - 25.0
    assert abs(apart) < 4.0 * float(table["mean_rate_difference_sigma"][0])
    assert float(table["mean_rate_difference_sigma"][0]) < 0.1
    assert np.median(table["rate_difference"].values[0]) == pytest.approx(25.0, abs=1.0)


def test_lock_time_is_when_the_difference_arrives() -> None:
    time = np.arange(0.0, 600.0, 0.1)
    psi = np.pi + 1.5 * np.exp(-time / 40.0)
    table = found(record_of(time + 7.0, swings(time, psi, np.random.default_rng(1), 1e-5)))
    assert float(table["lock_time"][0]) == pytest.approx(7.0 + 40.0 * np.log(15.0), abs=6.0)


def test_phases_and_amplitudes_are_those_put_in() -> None:
    time = np.arange(0.0, 200.0, 0.05)
    rows = np.stack([0.1 * np.cos(6.1 * time + 0.3), 0.05 * np.cos(6.1 * time - 0.4)])
    table = found(record_of(time, rows))
    assert np.abs(table["phase_difference"].values - 0.7).max() < 1e-6
    assert np.allclose(table["amplitude"].values, [[0.1], [0.05]], rtol=1e-6)
    assert float(table["amplitude_ratio"][0]) == pytest.approx(2.0, rel=1e-6)
    assert table["frequency"].values == pytest.approx([6.1, 6.1], rel=1e-9)


def test_the_phase_sigma_is_honest() -> None:
    """White noise of 1e-3: scatter of the phase difference against its stated sigma."""
    time = np.arange(0.0, 800.0, 0.1)
    chance = np.random.default_rng(8)
    turn = 2.0 * np.pi * time
    rows = 0.1 * np.cos(np.stack([turn, turn + 1.0])) + 1e-3 * chance.standard_normal((2, time.size))
    table = found(record_of(time, rows))
    scatter = float(np.std(table["phase_difference"].values[0]))
    assert scatter == pytest.approx(float(table["phase_difference_sigma"].values.mean()), rel=0.15)


def test_a_clock_and_a_difference_tell_the_same() -> None:
    record, _ = made("antiphase", 4)
    rows = record["record"]["elongation"].values
    other = record_of(record["time"].values, np.stack([rows[0], rows[0] - rows[1]]))
    other["record"]["combination"].values[1] = [1.0, -1.0]
    assert np.allclose(pendulums_of(other)[1], rows, equal_nan=True)
    assert found(other)["verdict"].values[0] == "antiphase"


def test_flags_of_the_film_reach_every_pair() -> None:
    record, _ = made("antiphase", 0)
    record["film"] = xr.DataTree(xr.Dataset(attrs={"flags": "marks-long-gap, marks-codes-disagree"}))
    with pytest.raises(RefusedError, match="--accept marks-codes-disagree"):
        pipeline.synchrony(record)
    rows = pipeline.summaries(pipeline.synchrony(record, accept=["marks-codes-disagree"]))
    assert all({"marks-long-gap", "marks-codes-disagree"} <= set(row["flags"]) for row in rows)


def test_three_clocks_make_three_pairs() -> None:
    time = np.arange(0.0, 300.0, 0.1)
    turn = 6.2 * time
    rows = 0.1 * np.cos(np.stack([turn, turn + np.pi, 1.001 * turn]))
    table = found(record_of(time, rows))
    assert table["pair"].values.tolist() == ["1-2", "1-3", "2-3"]
    assert table["verdict"].values.tolist() == ["antiphase", "drifting", "drifting"]


def test_the_beam_where_it_was_recorded() -> None:
    """1 mm up and down at twice the clocks' frequency, clocks of 0.1 rad: 0.01 m/rad."""
    time = np.arange(0.0, 300.0, 0.05)
    rows = 0.1 * np.cos(np.stack([6.0 * time, 6.0 * time + 1.0]))
    table = found(record_of(time, rows, vertical_acceleration=-144.0 * 1e-3 * np.cos(12.0 * time)))
    assert float(table["beam_amplitude"]) == pytest.approx(1e-3, rel=1e-3)
    assert table["beam_ratio"].values == pytest.approx([0.01, 0.01], rel=1e-3)


def test_allan_deviation_of_white_phase_noise() -> None:
    """sqrt(3) x/tau for independent errors of x seconds: the definition, and -1 on a doubly logarithmic sheet."""
    time, spread = np.arange(4096) * 1.0, 1e-3
    phase = 2.0 * np.pi * (time + spread * np.random.default_rng(2).standard_normal((2, time.size)))
    taus, deviation = verdict.allan_deviation(time, phase)
    assert taus.tolist() == (2.0 ** np.arange(taus.size)).tolist()
    assert deviation[:, :8] == pytest.approx(np.tile(np.sqrt(3.0) * spread / taus[:8], (2, 1)), rel=0.12)


def test_allan_deviation_takes_the_longest_stretch() -> None:
    time, phase = np.arange(400.0), np.full((2, 400), np.nan)
    phase[:, :150], phase[:, 200:] = 2.0 * np.pi * time[:150], 2.0 * np.pi * time[200:]
    taus, deviation = verdict.allan_deviation(time, phase)
    assert taus[-1] <= 64.0
    assert np.abs(deviation).max() < 1e-12
    assert verdict.allan_deviation(time[:4], phase[:, :4])[0].size == 0


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_allan_deviation_is_that_of_allantools() -> None:
    allantools = pytest.importorskip("allantools")
    chance = np.random.default_rng(4)
    for size in (8, 33, 1000):
        phase = 2.0 * np.pi * (np.arange(size) * 0.5 + 1e-3 * np.cumsum(chance.standard_normal((2, size)), axis=1))
        taus, deviation = verdict.allan_deviation(0.5 * np.arange(size), phase)
        for row, own in zip(phase, deviation, strict=True):
            ahead = row / ((row[-1] - row[0]) / (0.5 * (size - 1)))
            expected = allantools.oadev(ahead, rate=2.0, data_type="phase", taus="octave")
            assert taus == pytest.approx(expected[0])
            assert own == pytest.approx(expected[1], rel=1e-9)


def test_exchanging_the_clocks_turns_the_signs() -> None:
    time = np.arange(0.0, 300.0, 0.1)
    rows = swings(time, 0.5 * np.pi + np.exp(-time / 20.0), np.random.default_rng(1), 1e-4)
    one, two = found(record_of(time, rows)), found(record_of(time, rows[::-1].copy()))
    assert float(one["locked_angle"][0]) == pytest.approx(-float(two["locked_angle"][0]), abs=1e-9)
    assert float(one["mean_rate_difference"][0]) == pytest.approx(-float(two["mean_rate_difference"][0]), abs=1e-6)


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        (lambda time, rows: (time[:60], rows[:, :60]), RefusedError, "too few; record"),
        (lambda time, rows: (time[::8], rows[:, ::8]), RefusedError, "record them more often"),
        (lambda time, rows: (time, np.stack([rows[0], 0.0 * rows[1]])), RefusedError, "does not swing"),
        (lambda time, rows: (time, rows[:1]), RecordError, "no two pendulums apart"),
    ],
    ids=["short", "rarely read", "at rest", "one"],
)
def test_what_cannot_be_judged_is_refused(change, error, said) -> None:
    time = np.arange(0.0, 100.0, 0.1)
    rows = 0.1 * np.cos(np.stack([6.2 * time, 6.2 * time]))
    with pytest.raises(error, match=said):
        pipeline.synchrony(record_of(*change(time, rows)))


def test_confidence_falls_where_the_record_is_poor() -> None:
    """At the border between two angles the verdict is a toss-up, and says so."""
    time = np.arange(200.0)
    chance = np.random.default_rng(6)
    for angle, least, most in ((0.0, 0.999, 1.0), (np.radians(15.0), 0.2, 0.9)):
        said = judge(time, angle + 0.02 * chance.standard_normal(200), np.full(200, 0.02), ())
        assert least <= said["confidence"] <= most
