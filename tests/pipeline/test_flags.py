"""Each flag has a record that raises it and one that nearly does; a good record of half an hour carries none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr
from made_records import RESONANT, SWELL, changed, row, simulate

from pipeline.flag_words import OF_GRAVITY
from pipeline.reduction import SHORT_SECONDS

LONG = SHORT_SECONDS + 20.0
QUIET: dict[str, Any] = {"duration": LONG, "noise": 2e-5, "motion": [SWELL | {"amplitude": [0.02, 0.02, 0.02]}]}


def plain(**changes: Any) -> xr.DataTree:
    return simulate(**(QUIET | changes))[0]


def stated_noise(factor: float) -> xr.DataTree:
    return changed(plain(), "record", "elongation_uncertainty", np.full(2, 2e-5 * factor), ("trace",))


def period_uncertainty(share: float) -> xr.DataTree:
    """The share of the reading noise that the periods' uncertainty costs through n1/n2."""
    record = plain()
    found = row(record, "projection")
    relative = share * 1e-7 * found["gravity_sigma_mgal"] / abs(found["sensitivity_mgal"]["frequency_difference_1e-7"])
    period = record["instrument"]["period"].values
    return changed(record, "instrument", "period_uncertainty", period * np.array([relative, 0.0]), ("pendulum",))


def swaying(size: float) -> xr.DataTree:
    """Real pendulums, by the record's word, on a support that sways: Browne's term is size^2/(4 g)."""
    record = simulate(**(QUIET | {"motion": [SWELL | {"amplitude": [size, 0.0, 0.0]}], "noise": 1e-6}))[0]
    record["instrument"].attrs["restoring"] = "sine"
    return record


def coloured(size: float) -> xr.DataTree:
    """A weak harmonic that is no pendulum's near the swing in the difference."""
    record = plain()
    values = record["record"]["elongation"].values.copy()
    time = record.dataset["time"].values
    values[1] += size * np.cos(2 * np.pi * (1 / 1.0097648 + 0.02) * time)
    return changed(record, "record", "elongation", values)


def decaying(rate: float) -> xr.DataTree:
    return plain(damping=(rate, rate), write_damping=False)


def beating(phase: float) -> xr.DataTree:
    """Equal free amplitudes: |a|min/|a|max is set by the phases at the start."""
    return plain(eps=1e-3, free=((0.012, 0.0), (0.012, phase)), motion=[])


def heavier(factor: float) -> xr.DataTree:
    record = plain()
    return changed(record, "instrument", "period", record["instrument"]["period"].values * factor, ("pendulum",))


def losing(size: float) -> xr.DataTree:
    """A chronometer whose rate, without an uncertainty, is so many sigmas of gravity: 22.7 mGal for 1 s a day."""
    record = plain()
    return changed(
        record, "instrument", "chronometer_rate", size * row(record, "projection")["gravity_sigma_mgal"] / 22.7
    )


CASES: dict[str, tuple[Callable[[], xr.DataTree], Callable[[], xr.DataTree]]] = {
    "beats-through-zero": (lambda: beating(-0.15), lambda: beating(-0.3)),  # 0.09 and 0.17
    "short-record": (
        lambda: plain(duration=SHORT_SECONDS - 10.0),
        lambda: plain(duration=SHORT_SECONDS + 1.0),
    ),
    "frequency-difference-unresolved": (lambda: period_uncertainty(1.1), lambda: period_uncertainty(0.9)),
    "noise-above-stated": (lambda: stated_noise(0.65), lambda: stated_noise(0.85)),
    "noise-below-stated": (lambda: stated_noise(1.7), lambda: stated_noise(1.25)),
    "residual-not-white": (lambda: coloured(2.5e-5), lambda: coloured(3e-6)),
    "gravity-implausible": (lambda: heavier(1.0099), lambda: heavier(1.0005)),
    "acceleration-not-reduced": (lambda: swaying(0.02), lambda: swaying(0.003)),
    "correction-without-uncertainty": (lambda: losing(1.1), lambda: losing(0.9)),
    "damping-difference-assumed": (lambda: decaying(2e-4), lambda: decaying(0.0)),
}


JOINT = {"rewritten", "random-kicks", "gravity-changes", "friction-not-viscous", "apparatus-fault", "errors-not-white"}
"""Raised by `joint` alone, or of a file, and tested there."""


def test_every_flag_has_its_records() -> None:
    assert CASES.keys() | JOINT == OF_GRAVITY.keys()


@pytest.mark.parametrize("flag", CASES)
def test_raised_and_nearly_raised(flag: str) -> None:
    raising, nearly = CASES[flag]
    assert flag in row(raising(), "projection")["flags"]
    assert row(nearly(), "projection")["flags"] == []


@pytest.mark.parametrize("method", ["complex", "panteleev", "projection"])
def test_a_good_record_carries_no_flag(method: str) -> None:
    record = plain(motion=[SWELL, RESONANT | {"amplitude": 4e-5}])
    assert row(record, method)["flags"] == []


def test_flags_come_in_the_order_of_their_meanings() -> None:
    record = plain(duration=100.0, damping=(3e-4, 3e-4), write_damping=False)
    flags = row(record, "projection")["flags"]
    assert flags == [name for name in OF_GRAVITY if name in flags]
    assert len(flags) >= 2
