"""What a correction is given, and what it gives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pipeline.arrays import Floats
from pipeline.conditions import Constants

if TYPE_CHECKING:
    from pipeline.estimate import Estimate
    from pipeline.ledger.shares import Shares
    from pipeline.prepared import Prepared

MGAL = 1e-5  # m s-2
DAY = 86400.0  # s
UNKNOWN = float("nan")  # uncertainty of a correction whose input states none


@dataclass(frozen=True)
class Entry:
    """One correction as the result lists it, ADDED to gravity; mGal.

    `sigma` is NaN where an input states no uncertainty, `inputs` names the record's variables that were used.
    """

    value: float
    sigma: float
    applied: bool
    reason: str
    inputs: tuple[str, ...] = ()

    @property
    def input_names(self) -> str:
        """The inputs, separated by blanks."""
        return " ".join(self.inputs)


@dataclass(frozen=True)
class Change:
    """What a correction does: gravity after it (m s-2), its 1 sigma (mGal), why, and whether it was applied."""

    gravity: float
    sigma: float
    reason: str
    applied: bool = True


@dataclass(frozen=True)
class Case:
    """One method's estimate with all that corrections may ask.

    Attributes
    ----------
    estimate : Estimate
    prepared : Prepared
    gain_uncertainty : float
        Relative, 1 sigma.
    scale : float
        Change of gravity for a change of n2, mGal per rad s-1.
    by_ratio : float
        Change of gravity for a relative change of n1/n2, mGal.
    by_period : float
        Change of gravity for a relative change of the reference period, mGal: 2 g.
    """

    estimate: Estimate
    prepared: Prepared
    gain_uncertainty: float
    scale: float
    by_ratio: float
    by_period: float

    @cached_property
    def shares(self) -> Shares:
        """Parts of the estimate's own correction; found when they are asked for, gravity does not need them."""
        from pipeline.ledger.shares import shares

        return shares(self.estimate, self.prepared)

    def mean_over_record(self, series: Floats | float) -> float:
        """Mean of what changes n^2 within the record as it acts on the estimate; of a number, itself."""
        from pipeline.ledger.shares import mean_over_record

        if np.ndim(series) == 0:
            return float(series)
        seen = self.prepared.observation
        time, values = np.asarray(seen.course_time), np.asarray(series)
        if self.estimate.of_mean:
            return float(np.interp(seen.start + seen.time, time, values).mean())
        return mean_over_record(self.prepared, time, values)

    @property
    def by_gain(self) -> float:
        """Change of gravity for a relative change of the first trace's gain, mGal, arcs and all."""
        return self.scale * (self.prepared.rough_budget.by_gain + self.shares.by_gain)

    @property
    def by_gain_uncertainty(self) -> float:
        """1 sigma of gravity from the first trace's gain, mGal."""
        return abs(self.by_gain) * self.gain_uncertainty if self.gain_uncertainty else 0.0

    @property
    def period(self) -> float:
        """Period of the second pendulum as the instrument states it, s."""
        return 2.0 * np.pi / self.prepared.nominal

    def scalar(self, name: str) -> float:
        """A number of /instrument."""
        return float(self.prepared.observation.constants[name])

    def pair(self, name: str) -> Floats:
        """A number of /instrument for each of the two pendulums."""
        return np.asarray(self.prepared.observation.constants[name], dtype=np.float64)

    def uncertainty(self, name: str) -> float | None:
        """1 sigma of a number of /instrument; None where it states none."""
        stated = f"{name}_uncertainty"
        return self.scalar(stated) if stated in self.prepared.observation.constants else None

    def uncertainties(self, name: str) -> Floats | None:
        """The same for each of the two pendulums."""
        stated = f"{name}_uncertainty"
        return self.pair(stated) if stated in self.prepared.observation.constants else None

    def gravity_of(self, frequency: float) -> float:
        """Gravity of a frequency of the second pendulum in the record's own time at the stated period, m s-2."""
        return self.prepared.observation.reference_gravity * (frequency / self.prepared.nominal) ** 2

    def of_periods(self, first: float, second: float) -> float:
        """Change of gravity, mGal, if the two periods under the record's conditions were longer by these parts."""
        return -self.by_ratio * first + (self.by_ratio + self.by_period) * second

    def independent(self, changes: Floats) -> float:
        """1 sigma, mGal, of independent relative uncertainties of the two periods."""
        return float(np.hypot(self.of_periods(changes[0], 0.0), self.of_periods(0.0, changes[1])))

    def sigma(self, **parts: float | None) -> float:
        """Root sum of squares of 1-sigma parts; NaN where every one of them is None (states no uncertainty)."""
        known = [part for part in parts.values() if part is not None]
        return float(np.sqrt(sum(part**2 for part in known))) if known else UNKNOWN


def absent(constants: Constants, needs: tuple[str, ...]) -> str:
    """Which inputs the record lacks, as a reason; empty where it lacks none."""
    missing = [name for name in needs if name not in constants]
    return f"no instrument/{', '.join(missing)} in the record" if missing else ""


def uncertainty_told(sigma: float) -> str:
    """End of a reason: nothing, or that the inputs state no uncertainty."""
    return "; no uncertainty stated" if np.isnan(sigma) else ""
