"""From the frequency of the second pendulum to gravity, its uncertainty, its ledger and its sensitivities."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pipeline.conditions import MGAL
from pipeline.correction import NON_ISOCHRONISM
from pipeline.estimate import COLOUR_SECONDS, Estimate
from pipeline.harmonics.envelope import fill
from pipeline.ledger import book, own
from pipeline.ledger.entry import DAY, Case, Entry, arc_answer
from pipeline.prepared import Prepared

SOURCES = {"chronometer": "clock", "base_tie": "ratio"}  # Of the ledger's entries that bear another name in the budget
HALVED = 0.75  # of the variance, which must go
COLOUR = 1.6  # power near the pendulum's frequency over white
COLOUR_FLOOR = 3e-4  # of the amplitude: a residual below it is the method's, not the readings'
SPARSE = 2.0 * np.pi / 8.0  # rad of the swing between readings, from which the residual does not show it
LEFT_OUT = "terms that the method leaves out"

__all__ = ["DAY", "MGAL", "Entry", "Gravity", "gravity"]


@dataclass(frozen=True)
class Gravity:
    """Gravity of one method."""

    gravity: float  # m s-2
    sigma: float  # 1 sigma, mGal: reading noise and the uncertainties of the ledger's entries, independent
    noise: float  # 1 sigma from the readings alone, mGal
    frequency: tuple[float, float]  # n1, n2 after all corrections, rad s-1: `gravity = g_ref (n2/n2_ref)^2`
    per_ratio: float  # change of gravity, mGal, for n1/n2 larger by 1e-7
    left_out: float  # 1 sigma, mGal, of what acts on the pendulums and the method leaves as it is
    given: dict[str, Entry] = field(repr=False)  # entries of the ledger that the record states
    _case: Case = field(repr=False)

    @cached_property
    def ledger(self) -> dict[str, Entry]:
        """Name to `Entry`; the values add up to gravity less the uncorrected gravity."""
        return book.own_entries(self._case) | self.given

    @cached_property
    def budget(self) -> dict[str, float]:
        """Shares of the variance by source, the largest first: of the method's own, and of the ledger's entries."""
        found = {name: share * self.noise**2 for name, share in self._case.estimate.shares.items()}
        parts = (("scale", self._case.by_gain_uncertainty), (LEFT_OUT, self.left_out))
        for name, sigma in (*parts, *((name, entry.sigma) for name, entry in self.given.items())):
            if sigma > 0.0:
                source = SOURCES.get(name, name)
                found[source] = found.get(source, 0.0) + sigma**2
        total = sum(found.values())
        shares = sorted(found.items(), key=lambda each: -each[1])
        return {name: value / total for name, value in shares} if total > 0.0 else {}

    @property
    def advice(self) -> str:
        """What to improve, and how far, to halve sigma."""
        needed, together = [], 0.0
        for name, share in self.budget.items():
            needed.append(name)
            together += share
            if together > HALVED:
                if LEFT_OUT in needed:
                    return "to halve sigma, take joint"
                factor = np.sqrt(together / (together - HALVED))
                return f"to halve sigma, make the uncertainty of {' and '.join(needed)} {factor:.2g} times smaller"
        return ""

    @property
    def uncorrected(self) -> float:
        """Gravity of the uncorrected frequency, m s-2."""
        return self._case.gravity_of(self._case.estimate.uncorrected)

    @property
    def per_gain(self) -> float:
        """Change of gravity, mGal, for a gain of the first pendulum's trace larger by 1 %."""
        return self._case.by_gain * 1e-2


def gravity(estimate: Estimate, prepared: Prepared, gain_uncertainty: float = 0.0) -> Gravity:
    """`g = g_ref (n/n_ref)^2` of the second pendulum after every correction, with all that is known of its error.

    `gain_uncertainty` is the relative 1 sigma of the first pendulum's scale against the difference's.
    """
    seen = prepared.observation
    plain = seen.reference_gravity * (estimate.frequency / prepared.nominal) ** 2
    scale = 2.0 * plain / estimate.frequency / MGAL  # mGal per rad s-1
    by_ratio = scale * prepared.fine_budget.by_ratio
    case = Case(estimate, prepared, gain_uncertainty, scale, by_ratio * seen.frequency_ratio, 2.0 * plain / MGAL)
    value, given = book.given(case)
    noise, left = scale * estimate.sigma, left_out(case)
    parts = [noise, left, own.uncertainty(case), *(entry.sigma for entry in given.values())]
    n2 = prepared.nominal * float(np.sqrt(value / seen.reference_gravity))
    return Gravity(
        gravity=value,
        sigma=float(np.sqrt(np.nansum(np.square(parts)))),
        noise=noise,
        frequency=(n2 * float(seen.frequency_reference[0] / seen.frequency_reference[1]), n2),
        per_ratio=by_ratio * 1e-7,
        left_out=left,
        given=given,
        _case=case,
    )


def left_out(case: Case) -> float:
    """Size of what acts on the pendulums and the method leaves as it is, mGal.

    Non-isochronism where it takes nothing off; arcs and accelerations of real pendulums (Browne's terms) where it takes
    them as linear. Where no law is stated the residual tells whether they are, if there are readings enough.
    """
    estimate, prepared = case.estimate, case.prepared
    seen, parts = prepared.observation, [0.0]
    if estimate.shifts is not None and NON_ISOCHRONISM not in estimate.shifts:
        parts.append(case.scale * (prepared.fine.frequency - estimate.frequency))
    shown = structured(prepared, estimate) or seen.step * prepared.nominal > SPARSE
    real = seen.restoring == "sine" or (seen.restoring != "linear" and shown)
    if real and not estimate.acceleration_reduced:
        parts.append(0.5 * seen.reference_gravity * prepared.slow_square / MGAL)
        if seen.vertical is not None:
            parts.append(0.25 * float(np.nanmean(seen.vertical**2)) / seen.reference_gravity / MGAL)
        if not estimate.finite_arc:
            swings = fill(prepared.sliding.first), fill(prepared.sliding.difference)
            parts.append(case.scale * arc_answer(prepared, *swings, estimate.frequency))
    return float(np.linalg.norm(parts))


def structured(prepared: Prepared, estimate: Estimate) -> bool:
    """Whether the residual has structure near the pendulum's frequency that the readings' noise does not have."""
    rises = estimate.residual_colour > COLOUR + 5.0 / np.sqrt(prepared.observation.time[-1] / COLOUR_SECONDS)
    amplitude = float(np.nanmedian(np.abs(prepared.sliding.difference)))
    return bool(rises and estimate.noise * np.sqrt(max(estimate.residual_colour, 1.0)) > COLOUR_FLOOR * amplitude)
