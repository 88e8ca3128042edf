"""The closed form's rivals and its reference agree on a few seconds."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from pipeline.benchmarks import bars_speed, propagators
from pipeline.benchmarks.linear_hour import closed_form, reference, task
from pipeline.benchmarks.peers_linear import heyoka_taylor, scipy_dop853

pytest.importorskip("mpmath")
SHORT = task(3)
ROWS = np.arange(0, 60, 7)


def test_closed_form_is_exact() -> None:
    true = reference(SHORT, ROWS)
    assert np.abs(closed_form(SHORT)[:, ROWS] - true).max() < 1e-14 * np.abs(true).max()


def test_reference_starts_where_the_task_says() -> None:
    assert reference(SHORT, np.array([0]))[:, 0] == pytest.approx(SHORT.angle, rel=1e-14)


def test_dop853_solves_the_same_task() -> None:
    # three seconds at 1e-10: the error has no time to grow beyond a hundred tolerances
    assert scipy_dop853(SHORT, 1e-10, 1e-12)()[:, ROWS] == pytest.approx(reference(SHORT, ROWS), abs=1e-9)


@pytest.mark.skipif(importlib.util.find_spec("heyoka") is None, reason="heyoka is in the extra 'peers'")
@pytest.mark.parametrize("shared", [True, False])
def test_heyoka_solves_the_same_task(shared: bool) -> None:
    call = heyoka_taylor(SHORT, 1e-12, shared=shared)
    call()  # a second call starts anew
    assert call()[:, ROWS] == pytest.approx(reference(SHORT, ROWS), abs=1e-10)


@pytest.fixture
def sprint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(propagators, "QUICK", 2)
    monkeypatch.setattr(propagators, "HOUR", 2)


@pytest.mark.usefixtures("sprint")
@pytest.mark.parametrize("quick", [True, False])
def test_the_race_is_run(quick: bool) -> None:
    rows = list(propagators.run(quick=quick, folder=None))
    assert rows[0]["propagator"] == propagators.OWN
    assert rows[0]["error"] < 1e-14
    assert sum("DOP853" in row["propagator"] for row in rows) == 2


@pytest.mark.usefixtures("sprint")
def test_absent_peers_are_said_to_be_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    rows = list(propagators.run(quick=True, folder=None))
    assert [row["note"] for row in rows if "heyoka" in row["propagator"]] == ["not installed: extra 'peers'"]
    assert np.isnan(rows[0]["error"])  # without mpmath there is no reference


@pytest.mark.parametrize("installed", [True, False])
def test_bars_of_the_race(installed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    def made(*, quick: bool, folder: None) -> list[dict[str, object]]:
        def row(name: str, slower: float | None, error: float = 1e-7) -> dict[str, object]:
            return {"propagator": name, "simulated_s": 3600, "ms": 1.0, "error": error, "times_slower": slower}

        heyoka = [row("heyoka, non-compact, shared forcing, 1e-06", 60.0)] if installed else []
        slow = [row("scipy DOP853, rtol 1e-06", 9000.0, 1e-3), row("scipy DOP853, rtol 1e-09", 4000.0)]
        return [row(propagators.OWN, None, 1e-16), *heyoka, *slow]

    monkeypatch.setattr(propagators, "run", made)
    rows = list(bars_speed._race(quick=False))
    assert rows[0]["pass"]
    assert [row["pass"] for row in rows[1:3]] == ([None, True] if installed else [None, None])
    assert rows[3]["pass"] is False  # the faster run has too large an error to be compared
    assert [row["pass"] for row in bars_speed._race(quick=True)] == [True, None]
