"""What the paper neglects, in mGal, against what leaving it out costs."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.benchmarks.paper import neglected_terms
from pipeline.benchmarks.scenes import errors, linear, prepared, resonant, swell, two_pendulums
from pipeline.reduction import reduce_by

TERMS = {"first_speed", "first_growth", "forcing", "slow_difference", "damping_difference", "finite_arc"}


def test_every_term_has_a_figure() -> None:
    ready = prepared(two_pendulums("terms", 1e-4, duration=60.0, sampling_rate=10))
    found = neglected_terms(ready)
    assert set(found) == TERMS
    assert np.isfinite(list(found.values())).all()
    assert found["damping_difference"] == 0.0


@pytest.mark.compiled
def test_damping_difference_is_what_its_neglect_costs() -> None:
    rates = (1.3e-4, 1e-4)
    scene = two_pendulums("damping", 1e-4, damping_rates=rates)
    silent = two_pendulums("damping", 1e-4, damping_rates=rates, write_damping=False)
    error = errors(silent, "panteleev")["panteleev"]
    # second order: the neglected speed itself changes n2 within the correction, 1e-4 of it, and gamma2 is fitted
    assert neglected_terms(prepared(scene))["damping_difference"] == pytest.approx(error, rel=0.01)


@pytest.mark.compiled
def test_finite_arc_is_what_general_adds_for_it() -> None:
    ready = prepared(linear(write_restoring=False))
    found = reduce_by("general", ready, 0.0).gravity
    assert found is not None
    assert neglected_terms(ready)["finite_arc"] == pytest.approx(-found.ledger["finite_arc"].value, rel=0.01)


@pytest.mark.compiled
def test_forcing_is_twice_the_terms_of_26() -> None:
    found = neglected_terms(prepared(two_pendulums("forced", 1e-4, motion=[swell(), resonant()])))
    assert found["forcing"] == pytest.approx(2.0 * (found["first_speed"] + found["first_growth"]), rel=1e-9)


@pytest.mark.compiled
def test_slow_difference_grows_with_the_period_difference() -> None:
    small, large = (neglected_terms(prepared(two_pendulums("slow", eps)))["slow_difference"] for eps in (1e-6, 1e-5))
    # psi1 - psi2 is proportional to eps; the rest of the expression does not change by 1e-2 between the two
    assert large == pytest.approx(10.0 * small, rel=0.1)
