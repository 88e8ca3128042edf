"""`shooting` on real pendulums in a seaway, truth from scipy's DOP853."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from heavy_pair import G, observe

from data_schemas.errors import RefusedError
from pipeline.methods import method
from pipeline.methods.exact import invert
from pipeline.observation import Observation
from pipeline.prepared import Estimate, prepare
from pipeline.reduction import reduce_by


def error(seen: Observation) -> tuple[float, float, Estimate]:
    """Error and 1 sigma of gravity, mGal."""
    prepared = prepare(seen)
    found = invert(prepared)
    scale = 2e5 * G / found.frequency
    return (prepared.observation.felt_gravity(found.frequency) - G) * 1e5, found.sigma * scale, found


def thinned(seen: Observation, rows: Any, step: float) -> Observation:
    vertical = None if seen.vertical is None else seen.vertical[rows]
    return replace(
        seen,
        time=seen.time[rows],
        step=step,
        theta=seen.theta[rows],
        difference=seen.difference[rows],
        vertical=vertical,
    )


@pytest.mark.parametrize("heave", [False, True])
def test_exact_in_a_seaway(heave: bool) -> None:
    """The truth's own error, 1e-11 rad over 300 s, is 1e-4 mGal; linear projection errs by tens."""
    seen = observe(300.0, 0.04, heave=heave)
    off, _, found = error(seen)
    assert abs(off) < 2e-3
    assert found.noise < 1e-9
    prepared = prepare(seen)
    linear = method("projection")(prepared).frequency
    assert abs(prepared.observation.felt_gravity(linear) - G) > 10e-5


def test_fewer_readings_a_swing() -> None:
    """Eight readings a swing: the quadrature's own limit, some 1e-2 mGal in heavy motion."""
    seen = observe(300.0, 0.04, heave=True)
    assert abs(error(thinned(seen, slice(None, None, 3), 0.12))[0]) < 0.1


def test_damping_is_fitted_where_none_is_stated() -> None:
    """The damping difference is then taken as zero, which costs milligals; the rate itself must come out."""
    off, _, found = error(observe(300.0, 0.04, heave=True, damping_rate=None))
    assert abs(off) < 30.0
    assert found.damping_rate == pytest.approx(1.6e-4, abs=1e-4)  # the difference of 4e-5, taken as zero, goes into it


def test_linear_records_are_left_to_the_projection() -> None:
    seen = observe(300.0, 0.04, heave=False, restoring="linear")
    prepared = prepare(seen)
    assert method("shooting")(prepared).frequency == method("projection")(prepared).frequency


def test_what_it_reduces_is_not_flagged() -> None:
    reduced = {
        name: reduce_by(name, prepare(observe(300.0, 0.04, heave=True)), 0.0)
        for name in ("shooting", "general", "projection")
    }
    assert "acceleration-not-reduced" in reduced["projection"].flags
    assert all("acceleration-not-reduced" not in reduced[name].flags for name in ("shooting", "general"))


def test_heave_that_nobody_recorded_is_refused() -> None:
    with pytest.raises(RefusedError, match=r"vertical_acceleration: not recorded.*; use --method joint"):
        method("shooting")(prepare(observe(300.0, 0.04, heave=True, recorded=False)))


def test_a_recorded_heave_with_a_gap_is_refused() -> None:
    seen = observe(300.0, 0.04, heave=True)
    assert seen.vertical is not None
    seen.vertical[500] = np.nan
    with pytest.raises(RefusedError, match="vertical_acceleration: 1 readings are missing; use --method joint"):
        method("shooting")(prepare(seen))
