"""Two laws of restoring that are close, or of which one makes up for being wrong by what it adds."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from data_schemas.errors import RefusedError
from pipeline.benchmarks.records import record as honesty_record
from pipeline.joint import fit as recipe
from pipeline.joint.explanation import Candidate
from pipeline.joint.gather import gather
from pipeline.joint.start import first_fits

MGAL = 1e-5 / 9.81


def law_fit(*, sine: bool, value: float, mean: float, sigma: float) -> Any:
    """What a settled fit says of itself."""
    model = SimpleNamespace(assumed=SimpleNamespace(sine=sine), words=())
    own = SimpleNamespace(log_likelihood=value)
    candidate = Candidate(value, model, own)  # type: ignore[arg-type]
    return SimpleNamespace(model=model, solution=own, candidate=lambda: candidate, value=value, of=(mean, sigma))


@pytest.fixture(autouse=True)
def told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recipe, "of_the_law", lambda fit: fit.value)
    monkeypatch.setattr(recipe.choice, "averaged", lambda fit, _: fit.of)
    monkeypatch.setattr(recipe.choice, "unexplained", lambda _: 1.0)


def weighed(plain: float, other: float, apart: float = 4.0) -> tuple[bool, float, float]:
    """Whether the sine's law is taken, gravity above that of the sine's and its sigma, mGal.

    `plain` and `other` are the log-likelihoods of the settled fits, the sine's being the one that began ahead.
    """
    sine = law_fit(sine=True, value=plain, mean=1.0, sigma=0.1 * MGAL)
    linear = law_fit(sine=False, value=other, mean=1.0 - apart * MGAL, sigma=0.1 * MGAL)
    fit, close, mean, sigma = recipe.weighed([(sine, []), (linear, [])], 9.81)
    assert len(close) <= 1
    return fit.model.assumed.sine, (mean - 1.0) / MGAL, sigma / MGAL


def test_a_law_far_ahead_stands_alone() -> None:
    assert weighed(50.0, 0.0) == pytest.approx((True, 0.0, 0.1))


def test_close_laws_are_averaged() -> None:
    _, mean, sigma = weighed(1.0, 0.0)
    share = 1.0 / (1.0 + 2.718281828)
    assert mean == pytest.approx(-4.0 * share)
    assert sigma == pytest.approx((0.01 + share * (1.0 - share) * 16.0) ** 0.5)


@pytest.mark.parametrize("ahead", [0.5, 16.0, 60.0])
def test_a_law_that_overtakes_by_what_it_adds_is_half_believed(ahead: float) -> None:
    sine, mean, sigma = weighed(0.0, ahead)
    assert not sine
    assert mean == pytest.approx(-2.0)
    assert sigma > 2.0


def test_a_decisive_lead_is_believed() -> None:
    assert weighed(0.0, 150.0) == pytest.approx((False, -4.0, 0.1))


def test_close_laws_far_apart_are_refused() -> None:
    with pytest.raises(RefusedError, match="state restoring"):
        weighed(0.0, 5.0, apart=12.0)


@pytest.mark.compiled
@pytest.mark.parametrize(("kind", "laws"), [("heave recorded", [True]), ("linear law not stated", [False, True])])
def test_a_law_far_behind_is_given_up(kind: str, laws: list[bool]) -> None:
    """Heave tells the law from the cold start on; two laws that are close are both fitted, the likelier first."""
    made = honesty_record(kind, "weak", 1).tree
    made["instrument"].attrs.pop("restoring", None)
    assert [fit.model.assumed.sine for fit in first_fits(gather(made))] == laws
