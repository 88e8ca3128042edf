"""What a correction is given, and what it gives.

An exact method gives one frequency and no parts. What a known disturbance adds to the frequency is its response: the
disturbance moves the phasor of the difference by dD(t), and the least squares of the complex form answers with `d n2 =
Re sum conj(g) dD`, g its influence. That holds through zero amplitude, with gaps, and with damping fitted, where
averages of a phase speed do not.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.conditions import Constants
from pipeline.harmonics.envelope import SlowMotion, fill
from pipeline.harmonics.narrowband import running_integral
from pipeline.prepared import Estimate, Prepared

ASSUMED = 0.01  # of a correction whose inputs state no uncertainty, 1 sigma


@dataclass(frozen=True)
class Entry:
    """One correction as the result lists it, ADDED to gravity; mGal.

    Where no input states its uncertainty (`stated` is false), `sigma` is `ASSUMED` of the value; `inputs` names the
    record's variables that were used, separated by blanks.
    """

    value: float
    sigma: float
    applied: bool
    reason: str
    inputs: str = ""
    stated: bool = True


class Change(NamedTuple):
    """What a correction does."""

    gravity: float  # after it, m s-2
    sigma: float  # 1 sigma, mGal; NaN = not stated
    reason: str
    applied: bool = True


@dataclass(frozen=True, eq=False)
class Correction:
    """One correction; `change(case, gravity)` gives the next value of gravity, m s-2."""

    NAME: str  # in results
    FORMULA: str  # in words and symbols
    SOURCE: str  # of the formula
    NEEDS: tuple[str, ...]  # variables of /instrument without which it is listed as not applied
    USES: tuple[str, ...]  # further ones that it may use, the uncertainties of NEEDS apart
    change: "Callable[[Case, float], Change]"


def correction(
    name: str, formula: str, source: str, needs: tuple[str, ...] = (), *, uses: tuple[str, ...] = ()
) -> "Callable[[Callable[[Case, float], Change]], Correction]":
    """Make a correction of the function that follows."""
    return lambda change: Correction(name, formula, source, needs, uses, change)


@dataclass(frozen=True)
class Case:
    """One method's estimate with all that corrections may ask."""

    estimate: Estimate
    prepared: Prepared
    gain_uncertainty: float  # relative, 1 sigma
    scale: float  # change of gravity for a change of n2, mGal per rad s-1
    by_ratio: float  # change of gravity for a relative change of n1/n2, mGal
    by_period: float  # the same of the reference period: 2 g

    @cached_property
    def shares(self) -> "Shares":
        """Parts of the estimate's own correction; gravity does not need them."""
        return shares(self.estimate, self.prepared)

    def mean_over_record(self, series: Floats | float) -> float:
        """Mean of what changes n^2 within the record as it acts on the estimate; of a number, itself."""
        seen, values = self.prepared.observation, np.asarray(series)
        if values.ndim == 0:
            return float(values)
        time = np.asarray(seen.course_time)
        if self.estimate.of_mean:
            return float(np.interp(seen.start + seen.time, time, values).mean())
        return mean_over_record(self.prepared, time, values)

    @property
    def by_gain(self) -> float:
        """Change of gravity for a relative change of the first trace's gain, mGal, arcs and all."""
        return self.scale * (self.prepared.fine_budget.by_gain + self.shares.by_gain)

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

    def uncertainty(self, name: str) -> Any:
        """1 sigma of a number of /instrument, or of both pendulums' numbers; None where it states none."""
        return self.prepared.observation.constants.get(f"{name}_uncertainty")

    def gravity_of(self, frequency: float) -> float:
        """Gravity of a frequency of the second pendulum in the record's own time at the stated period, m s-2."""
        return self.prepared.observation.reference_gravity * (frequency / self.prepared.nominal) ** 2

    def of_periods(self, first: float, second: float) -> float:
        """Change of gravity, mGal, if the two periods under the record's conditions were longer by these parts."""
        return -self.by_ratio * first + (self.by_ratio + self.by_period) * second

    def independent(self, changes: Floats) -> float:
        """1 sigma, mGal, of independent relative uncertainties of the two periods."""
        return float(np.hypot(self.of_periods(changes[0], 0.0), self.of_periods(0.0, changes[1])))

    def sigma(self, *parts: float | None) -> float:
        """Root sum of squares of 1-sigma parts; NaN where every one of them is None (states no uncertainty)."""
        known = [part for part in parts if part is not None]
        return float(np.linalg.norm(known)) if known else float("nan")

    def alone(self, first: float, second: float) -> str:
        """What either pendulum alone would need, mGal, in words."""
        seen = self.prepared.observation
        return f"pendulum {seen.first} alone {first:+.2f} mGal, pendulum {seen.second} {second:+.2f}"


def absent(constants: Constants, needs: tuple[str, ...]) -> str:
    """Which inputs the record lacks, as a reason; empty where it lacks none."""
    missing = [name for name in needs if name not in constants]
    return f"no instrument/{', '.join(missing)} in the record" if missing else ""


@dataclass(frozen=True)
class Shares:
    """Parts of a method's own correction of n2, rad s-1, ADDED."""

    arc: float = 0.0  # finite arc
    horizontal: float = 0.0  # acceleration of the support
    vertical: float = 0.0
    by_gain: float = 0.0  # change of all of them for a relative change of the first trace's gain
    squares: tuple[float, float] = (0.0, 0.0)  # mean square amplitudes of the two pendulums, rad2
    reduced: bool = False  # whether the method reduces accelerations as they act on real pendulums


def shares(estimate: Estimate, prepared: Prepared) -> Shares:
    """Split what a method corrected; nothing for methods that take the pendulums as linear."""
    if not estimate.acceleration_reduced and estimate.finite_arc == 0.0:
        return Shares()
    envelope, frequency = prepared.sliding, estimate.frequency
    first, difference = fill(envelope.first), fill(envelope.difference)
    own = -arc_answer(prepared, first, difference, frequency)
    gained = -arc_answer(prepared, 1.01 * first, difference, frequency)
    arc = estimate.finite_arc if estimate.finite_arc != 0.0 else own
    horizontal = vertical = 0.0
    if estimate.acceleration_reduced:
        slow = prepared.slow_motion
        still = replace(slow, zeta=None)
        horizontal = -turned(prepared, gained_phase(still, frequency, envelope.time))
        if slow.zeta is not None:
            vertical = -turned(prepared, gained_phase(slow, frequency, envelope.time)) - horizontal
    return Shares(
        arc=arc,
        horizontal=horizontal,
        vertical=vertical,
        by_gain=(gained - own) / 0.01 + 2.0 * horizontal,  # the slow motion enters squared
        squares=(_square(envelope.first), _square(envelope.first - envelope.difference)),
        reduced=estimate.acceleration_reduced,
    )


def arc_answer(prepared: Prepared, first: Complexes, difference: Complexes, frequency: float) -> float:
    """What the finite arcs of both pendulums add to n2, rad s-1 (they make it smaller)."""
    second = first - difference
    # Z_i' gains -(i n/16) |Z_i|^2 Z_i
    forcing = -1j * frequency / 16.0 * (np.abs(first) ** 2 * first - np.abs(second) ** 2 * second)
    growth = prepared.fine.jacobian[0]
    return _answer(prepared, growth * running_integral(forcing / growth, prepared.sliding.hop))


def gained_phase(slow: SlowMotion, frequency: float, time: Floats) -> Floats:
    """Phase that a swing gains by the support's acceleration, rad, from its second order on.

    Heave acts in first order too, but to and fro: over a record nothing is left but what its ends happen to cut off.
    """
    phase = slow.phase(frequency, slow.time)
    if slow.zeta is not None:
        half = 0.25 * frequency * slow.step * (slow.zeta[1:] + slow.zeta[:-1])
        phase = phase - np.concatenate([[0.0], np.cumsum(half)])
    steady = float((phase[-1] - phase[0]) / (slow.time[-1] - slow.time[0]))
    return np.asarray(np.interp(time, slow.time, phase - steady * slow.time) + steady * time)


def turned(prepared: Prepared, phase: Floats) -> float:
    """What a phase that both pendulums gain alike, (k,) rad at the blocks' instants, adds to n2, rad s-1.

    D' gains i phase' D, whose response is `growth int i phase' D/growth dt`; the first pendulum is an input as it is.
    """
    growth = prepared.fine.jacobian[0]
    swing = fill(prepared.sliding.difference) / growth
    steps = 0.5j * np.diff(phase) * (swing[1:] + swing[:-1])
    return _answer(prepared, growth * np.concatenate([[0.0], np.cumsum(steps)]))


def mean_over_record(prepared: Prepared, time: Floats, series: Floats) -> float:
    """Mean of a course (m,) at times (m,), s by the record's clock, as it acts on n2, which changes in proportion."""
    centre = float(series.mean())
    grown = np.concatenate([[0.0], np.cumsum(0.5 * (series[1:] + series[:-1] - 2.0 * centre) * np.diff(time))])
    at = np.interp(prepared.sliding.time + prepared.observation.start, time, grown)
    return centre + turned(prepared, at)


def _answer(prepared: Prepared, moved: Complexes) -> float:
    return float((np.conj(prepared.fine_budget.influence) @ moved).real)


def _square(harmonic: Complexes) -> float:
    return float(np.nanmean(np.abs(harmonic) ** 2))
