"""The drive: travel is the integral of the speed, time its inverse, and wow moves rows as integrated."""

from __future__ import annotations

import numpy as np
import pytest
from made_films import SMALL, planned, rest

from data_schemas.scene_recording import Film
from synth.film.layout import Transport

DRIVES = {
    "even": {},
    "drift": {"drift": -0.3},
    "wow": {"wow": 0.03, "wow_period": 3.0},
    "walk": {"walk": 0.02, "walk_time": 2.0},
    "all": {"drift": 0.1, "wow": 0.1, "wow_period": 0.9, "walk": 0.05, "walk_time": 1.0},
}


@pytest.fixture(params=DRIVES.values(), ids=DRIVES)
def drive(request):
    return Transport(Film(speed=4.0, **request.param), 10.0, 40.0, 5)


def test_travel_is_the_integral_of_the_speed(drive):
    time = np.linspace(10.0, 40.0, 300_001)
    speed = drive.speed(time)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * 1e-4])
    # trapezia of 0.1 ms: h^2 / 12 v''
    np.testing.assert_allclose(drive.travel(time), travelled, atol=2e-6)
    assert drive.travel(time[:1])[0] == pytest.approx(0.0, abs=1e-12)
    assert drive.length == pytest.approx(travelled[-1], abs=2e-6)


def test_time_is_the_inverse(drive):
    travel = np.linspace(-30.0, drive.length + 30.0, 1001)
    np.testing.assert_allclose(drive.travel(drive.time_at(travel)), travel, atol=1e-9)


def test_a_drive_beyond_the_record_goes_on_as_it_was(drive):
    assert drive.travel(np.array([42.0]))[0] - drive.length == pytest.approx(2.0 * drive.speed(np.array([40.0]))[0])


def test_chance_is_the_seeds():
    film = Film(walk=0.01)
    time = np.linspace(0.0, 100.0, 50)
    same = Transport(film, 0.0, 100.0, 1).travel(time)
    np.testing.assert_array_equal(Transport(film, 0.0, 100.0, 1).travel(time), same)
    assert np.any(Transport(film, 0.0, 100.0, 2).travel(time) != same)


def test_the_walk_is_as_strong_as_it_says_and_as_long():
    walk = Transport(Film(speed=1.0, walk=0.02, walk_time=5.0), 0.0, 1e5, 3).speed(np.arange(0.0, 1e5, 0.625)) - 1.0
    # 20 000 correlation times: 1 % of the rms
    assert walk.std() == pytest.approx(0.02, rel=0.03)
    lagged = np.mean(walk[8:] * walk[:-8]) / np.mean(walk**2)  # 5 s
    assert lagged == pytest.approx(np.exp(-1.0), abs=0.02)


def test_wow_moves_marks_as_integrated():
    film = Film(**SMALL | {"gap": 0.03}, wow=0.05, wow_period=2.0)
    plan = planned(film, rest, seconds=8.0)
    phase = plan.transport._phase
    time = plan.marks.time
    run = time + 0.05 / np.pi * (np.cos(phase) - np.cos(np.pi * time + phase))
    rows = plan.geometry.row_at_left(plan.transport.travel(time))
    np.testing.assert_allclose(rows, (2.0 + 5.0 * run) * 300 / 25.4, atol=1e-9)
