"""Extreme records: a value with its error, or a refusal by name; never silently wrong, never a traceback.

A method that is known to be wrong by construction (`uncorrected`, `vening-meinesz`; `panteleev` where the frequencies
stand far apart) is not asked for the truth, only for a value or a refusal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr
from made_records import GRAVITY, SWELL, changed, simulate

from data_schemas.errors import IsochronyError
from pipeline import process, summaries
from pipeline.methods import PAIR_METHODS

NOISE: dict[str, Any] = {"noise": 2e-5}
MUST_BE_RIGHT = ("complex", "projection")
_random = np.random.default_rng


def edited(edit: Callable[[np.ndarray], None], **scene: Any) -> xr.DataTree:
    record = simulate(**({"duration": 320.0} | NOISE | scene))[0]
    values = record["record"]["elongation"].values.copy()
    edit(values)
    return changed(record, "record", "elongation", values)


def put(trace: int | slice, where: slice | np.ndarray, value: float) -> Callable[[np.ndarray], None]:
    def edit(values: np.ndarray) -> None:
        values[trace, where] = value

    return edit


def pure_noise(trace: int | slice) -> Callable[[np.ndarray], None]:
    def edit(values: np.ndarray) -> None:
        values[trace] = _random(0).normal(0.0, 1e-3, values[trace].shape)

    return edit


def scaled_by(factor: float) -> Callable[[np.ndarray], None]:
    def edit(values: np.ndarray) -> None:
        values *= factor

    return edit


def nominal(factor: float | tuple[float, float]) -> xr.DataTree:
    record = simulate(duration=320.0, **NOISE)[0]
    period = record["instrument"]["period"].values
    return changed(record, "instrument", "period", period * np.array(factor), ("pendulum",))


def made(**scene: Any) -> Callable[[], xr.DataTree]:
    return lambda: simulate(**({"duration": 320.0} | NOISE | scene))[0]


ALL = slice(None)
RECORDS: dict[str, Callable[[], xr.DataTree]] = {
    "a through zero": made(eps=1e-3, free=((0.01, 0.0), (0.01, 0.7))),
    "equal frequencies": made(eps=0.0),
    "detuning 1e-12": made(eps=1e-12),
    "Theta1/a = 10": made(free=((0.05, 0.0), (0.05, 0.1))),
    "linear pendulums of 1 rad": made(free=((1.0, 0.4), (1.0, 2.2))),
    "far apart": made(eps=0.01),
    "a minute of the difference lost": lambda: edited(put(1, slice(1000, 1600), np.nan)),
    "a minute of both lost": lambda: edited(put(ALL, slice(1000, 1600), np.nan)),
    "a minute of the first lost": lambda: edited(put(0, slice(1000, 1600), np.nan)),
    "four seconds of the first lost": lambda: edited(put(0, slice(1000, 1040), np.nan)),
    "ten seconds lost at the start": lambda: edited(put(ALL, slice(0, 100), np.nan)),
    "ten seconds left of the difference": lambda: edited(put(1, slice(100, None), np.nan)),
    "two ends of the difference left": lambda: edited(put(1, slice(300, -300), np.nan)),
    "four fifths of the difference lost": lambda: edited(put(1, _random(1).random(3200) < 0.8, np.nan)),
    "half of both lost": lambda: edited(put(ALL, _random(1).random(3200) < 0.5, np.nan)),
    "difference all missing": lambda: edited(put(1, ALL, np.nan)),
    "first all missing": lambda: edited(put(0, ALL, np.nan)),
    "ten seconds": made(duration=10.0),
    "twenty-two seconds": made(duration=22.0),
    "two samples a swing": made(sampling_rate=2),
    "two samples a swing, twenty minutes": made(marks=True, duration=1200.0),
    "one sample a swing": made(sampling_rate=1),
    "three samples a swing": made(sampling_rate=3),
    "pure noise": lambda: edited(pure_noise(ALL)),
    "pure noise for the difference": lambda: edited(pure_noise(1)),
    "zero for the difference": lambda: edited(put(1, ALL, 0.0)),
    "nothing but zeros": lambda: edited(put(ALL, ALL, 0.0)),
    "a constant difference": lambda: edited(put(1, ALL, 0.3)),
    "readings of 1e-200": lambda: edited(scaled_by(1e-200)),
    "readings of 1e150": lambda: edited(scaled_by(1e150)),
    "nominal period 0.5 % long": lambda: nominal(1.005),
    "nominal period 0.5 % short": lambda: nominal(0.995),
    "nominal period 5 % long": lambda: nominal(1.05),
    "nominal period 5 % short": lambda: nominal(0.95),
    "nominal period 20 % long": lambda: nominal(1.2),
    "nominal period 20 % short": lambda: nominal(0.8),
    "nominal period of the first 1 % off": lambda: nominal((1.01, 1.0)),
    "periods exchanged": lambda: nominal((1.0001, 1 / 1.0001)),
    "damping near the limit": made(damping=(0.05, 0.05)),
    "wild readings by the hundred": made(outliers=100, outlier_amplitude=0.01),
    "noise half the swing": made(noise=5e-3),
    "noise above the swing": made(noise=2e-2),
    "swell of two seconds": made(motion=[SWELL | {"amplitude": [1.0, 0.0, 0.0], "period": [2.0, 7.0, 5.0]}]),
    "vibration above Nyquist": made(motion=[SWELL | {"amplitude": [1.0, 0.0, 0.0], "period": [0.11, 7.0, 5.0]}]),
    "forcing at exact resonance": made(motion=[{"kind": "near-resonant", "amplitude": 4e-3, "detuning": 0.0}]),
}


def rows_or_refusal(name: str) -> list[dict[str, Any]] | str:
    try:
        return summaries(process(RECORDS[name](), method=PAIR_METHODS))
    except IsochronyError as error:  # anything else is a traceback at the user, and fails
        return str(error)


@pytest.mark.parametrize("name", RECORDS)
def test_a_value_with_its_error_or_a_refusal_by_name(name: str) -> None:
    rows = rows_or_refusal(name)
    if isinstance(rows, str):
        assert "\n" not in rows
        assert ":" in rows  # variable, then remedy
        return
    for found in rows:
        if found["status"] != "ok":
            assert found["error"]
            continue
        assert np.isfinite(found["gravity_m_s2"])
        assert found["gravity_sigma_mgal"] > 0.0
        if found["requested_method"] in MUST_BE_RIGHT and not found["flags"]:
            departure = abs(found["gravity_m_s2"] - GRAVITY) * 1e5
            assert departure < 5.0 * found["gravity_sigma_mgal"], (found["requested_method"], departure)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("method", ["panteleev", "complex", "projection"])
def test_pure_noise_gives_no_gravity(method: str, seed: int) -> None:
    """Whatever the noise happens to look like, and with no stated noise to compare it with."""
    record = simulate(duration=320.0)[0]
    noise = _random(seed).normal(0.0, 1e-3, record["record"]["elongation"].shape)
    found = summaries(process(changed(record, "record", "elongation", noise), method=method))[0]
    assert found["status"] == "refused"


BY_DEFAULT = {
    "a through zero": 1.0,
    "equal frequencies": 1.0,
    "Theta1/a = 10": 2.0,  # the difference passes through zero
    "four fifths of the difference lost": 2.0,
    "half of both lost": 2.0,
    "a minute of both lost": 5.0,
    "wild readings by the hundred": 1.0,
    "two samples a swing, twenty minutes": 5.0,
    "one sample a swing": 2.0,
}
"""Largest sigma, mGal, that the default method may state of them."""
NONSENSE = ("first all missing", "ten seconds", "pure noise", "nothing but zeros")


@pytest.mark.compiled
@pytest.mark.parametrize("name", BY_DEFAULT)
def test_the_default_method_takes_what_can_be_reduced(name: str) -> None:
    (found,) = summaries(process(RECORDS[name]()))
    assert found["method"] == "joint"
    assert abs(found["gravity_m_s2"] - GRAVITY) * 1e5 < 4.0 * found["gravity_sigma_mgal"]
    assert found["gravity_sigma_mgal"] < BY_DEFAULT[name]


@pytest.mark.compiled
@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(IsochronyError, match=r"^[\w/ ]+: [^\n]+$"):
        process(RECORDS[name]())
