"""Stated intervals hold the truth as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from random_records import KINDS, many

EXACT_FORMS = ("projection", "complex")


@pytest.mark.compiled
@pytest.mark.parametrize("kind", ["plain", "damped"])
def test_95_per_cent_of_200_records(kind: str) -> None:
    """Binomial: 190 +- 3.1 of 200; three sigmas are 4.6 %. RMSE of 200 is good to 5 %, two and a half sigmas."""
    for outcome in many(kind, 1e-4, EXACT_FORMS, 200).values():
        assert abs(outcome.coverage - 0.95) < 0.047
        assert outcome.ratio == pytest.approx(1.0, abs=0.125)
        assert abs(np.mean(outcome.errors / outcome.sigmas)) < 3.0 / np.sqrt(200)


@pytest.mark.compiled
def test_clean_records_carry_no_flag_but_that_they_are_short() -> None:
    outcome = many("plain", 1e-4, ("projection",), 100, 5000)["projection"]
    assert outcome.flags.keys() <= {"short-record", "residual-not-white", "noise-above-stated", "noise-below-stated"}
    assert sum(n for flag, n in outcome.flags.items() if flag != "short-record") <= 1


@pytest.mark.campaign
@pytest.mark.parametrize("eps", [1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("kind", KINDS)
def test_95_per_cent_of_2000_records(kind: str, eps: float) -> None:
    """The issue's bar, 93.5 to 96.5 % and 0.9 to 1.1; 2000 records know the coverage to 0.5 %, the ratio to 1.6 %."""
    told = []
    for method, outcome in many(kind, eps, EXACT_FORMS, 2000).items():
        told.append(f"{kind} {eps:g} {method}: coverage {outcome.coverage:.4f}, ratio {outcome.ratio:.3f}, ")
        told[-1] += f"mean sigma {np.mean(outcome.sigmas):.4f} mGal, flags {outcome.flags}"
        print(told[-1])
        assert 0.935 <= outcome.coverage <= 0.965, told[-1]
        assert 0.9 <= outcome.ratio <= 1.1, told[-1]
