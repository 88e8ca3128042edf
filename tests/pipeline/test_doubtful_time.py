"""Times that are uncertain widen sigma by as much as they may be wrong; a film's doubts reach the result, or block."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import changed, row, simulate

from data_schemas.errors import RefusedError
from pipeline import process
from pipeline.conditions import rate_uncertainty
from pipeline.flag_words import BLOCKING, OF_FILM

TIME = np.arange(400.0)
SHAPES = {
    "constant": np.full(400, 0.7),
    "step": 0.5 * (TIME >= 150),
    "step back": 0.5 * (TIME < 150) + 0.1,
    "hump": 0.2 + 1.0 * ((TIME > 100) & (TIME < 180)),
    "stairs": 0.1 * (TIME // 50),
    "hill": 2.0 - np.abs(TIME - 170.0) / 200.0,
    "two humps": 0.3 * (TIME > 30) + 0.5 * ((TIME > 60) & (TIME < 90)) + 0.4 * ((TIME > 200) & (TIME < 390)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_rate_uncertainty_by_its_covariance(shape: str) -> None:
    """Two times share the least variance of all between them."""
    sigma = SHAPES[shape]
    covariance = np.empty((400, 400))
    for k in range(400):
        covariance[k, k:] = np.minimum.accumulate(sigma[k:] ** 2)
        covariance[k:, k] = covariance[k, k:]
    slope = TIME - TIME.mean()
    slope /= slope @ slope
    assert rate_uncertainty(TIME, sigma) ** 2 == pytest.approx(slope @ covariance @ slope, rel=1e-9, abs=1e-20)


@pytest.fixture(scope="module")
def record() -> xr.DataTree:
    return simulate(noise=1e-5)[0]


@pytest.mark.parametrize("method", ["projection", "joint"])
def test_sigma_covers_a_step_of_the_clock_that_may_be(record: xr.DataTree, method: str) -> None:
    """Half a second at the middle: at most 1.5 times the step over the length, in gravity twice that."""
    time = record.dataset["time"].values
    doubtful = changed(record, "record", "time_uncertainty", 0.5 * (time >= time.mean()), ("time",))
    own, plain = row(doubtful, method), row(record, method)
    expected = 2.0 * 9.8054e5 * 1.5 * 0.5 / (time[-1] - time[0])
    assert np.sqrt(own["gravity_sigma_mgal"] ** 2 - plain["gravity_sigma_mgal"] ** 2) == pytest.approx(
        expected, rel=0.01
    )
    assert own["gravity_m_s2"] == plain["gravity_m_s2"]


def test_sigma_of_a_period_holds_the_clock(record: xr.DataTree) -> None:
    single = record.isel(trace=[0], pendulum=[0])
    time = single.dataset["time"].values
    doubtful = changed(single, "record", "time_uncertainty", 0.5 * (time >= time.mean()), ("time",))
    own, plain = row(doubtful, "auto"), row(single, "auto")
    more = np.sqrt(own["period_sigma_s"] ** 2 - plain["period_sigma_s"] ** 2) / own["period_s"]
    assert more == pytest.approx(1.5 * 0.5 / (time[-1] - time[0]), rel=0.01)


def filmed(record: xr.DataTree, flags: str) -> xr.DataTree:
    tree = record.copy()
    tree["film"] = xr.DataTree(xr.Dataset(attrs={"flags": flags}))
    return tree


def test_film_flags_reach_the_result(record: xr.DataTree) -> None:
    assert set(BLOCKING) < set(OF_FILM)
    assert row(filmed(record, "marks-false, film-stood-still"), "projection")["flags"][-2:] == [
        "marks-false",
        "film-stood-still",
    ]
    assert "marks-false" in row(filmed(record, "marks-false").isel(trace=[0], pendulum=[0]), "auto")["flags"]


@pytest.mark.parametrize("flag", BLOCKING)
def test_doubtful_time_blocks_unless_accepted(record: xr.DataTree, flag: str) -> None:
    doubtful = filmed(record, f"marks-false, {flag}")
    with pytest.raises(RefusedError, match=f"film: {flag}: .*; --accept {flag} reduces the record all the same"):
        process(doubtful, method="projection")
    assert flag in row(doubtful, "projection", accept=[flag])["flags"]
