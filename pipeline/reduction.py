"""One method on one prepared record: its gravity and the flags that it raises, or why it refused."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.estimate import Estimate
from pipeline.flag_words import BLOCKING, FLAGS, OF_GRAVITY, told
from pipeline.gravity import MGAL, Gravity, gravity, structured
from pipeline.methods import method
from pipeline.methods.phases import passes_zero
from pipeline.prepared import CAPTURE, Prepared

if TYPE_CHECKING:
    from xarray import DataTree

SHORT_SECONDS = 300.0  # below it the near-resonant beat and the damping are not told from the frequency
NOISE_ABOVE, NOISE_BELOW = 1.3, 0.7  # found over stated
LEAST_BROWNE = 0.05  # mGal of horizontal acceleration
IMPLAUSIBLE = (9.75, 9.85)  # m s-2; at sea gravity lies between 9.77 and 9.84

DAMPING_ASSUMED = "damping-difference-assumed"
_DECAY = 3e-6  # s-1: one per cent of it as a difference costs about 0.01 mGal at a relative period difference of 1e-4
DAMPING_DOUBT = 0.3  # 1 sigma of a difference of damping that is not stated, over the damping


@dataclass(frozen=True)
class Reduction:
    """Outcome of one method; `estimate` and `gravity` are None when it refused."""

    requested: str
    method: str
    reason: str = ""
    estimate: Estimate | None = None
    gravity: Gravity | None = None
    flags: tuple[str, ...] = ()
    error: str = ""
    elapsed: float = 0.0


def refused(name: str, refusal: RefusedError, started: float) -> Reduction:
    """Outcome of a method that refused, begun at a time of `perf_counter`."""
    return Reduction(name, name, error=str(refusal), elapsed=time.perf_counter() - started)


def reduce_by(name: str, prepared: Prepared, gain_uncertainty: float) -> Reduction:
    """Run a method and complete it with gravity and flags."""
    started = time.perf_counter()
    try:
        estimate = method(name)(prepared)
        if prepared.known_damping is None:
            doubt = DAMPING_DOUBT * estimate.damping_rate * prepared.fine_budget.by_damping
            estimate = replace(estimate, sigma=float(np.hypot(estimate.sigma, doubt)))
        departure = estimate.frequency / prepared.nominal - 1.0
        if not np.isfinite(departure) or abs(departure) > CAPTURE:
            raise RefusedError(
                f"instrument/period: the swing found departs by {100 * departure:.1f} % from the stated period; "
                "check the period and the time axis"
            )
    except RefusedError as refusal:
        return refused(name, refusal, started)
    value = gravity(estimate, prepared, gain_uncertainty)
    raised = tuple(flags(prepared, estimate, value))
    return Reduction(name, name, "", estimate, value, raised, elapsed=time.perf_counter() - started)


def of_film(record: DataTree, accept: Collection[str]) -> tuple[str, ...]:
    """What the reading of the film left doubtful, as /film of a record says.

    `RefusedError`: time or scale is doubtful, and the flag is not among those that are accepted.
    """
    if "film" not in record.children:
        return ()
    found = tuple(name for name in str(record["film"].attrs.get("flags", "")).split(", ") if name in FLAGS)
    for name in found:
        if name in BLOCKING and name not in accept:
            raise RefusedError(f"film: {name}: {told(name)}; --accept {name} reduces the record all the same")
    return found


def flags(prepared: Prepared, estimate: Estimate, value: Gravity) -> list[str]:
    """Flags of one method on one record, in the order of `flag_words.OF_GRAVITY`."""
    seen = prepared.observation
    envelope = prepared.sliding
    beyond = np.array([0.0, seen.time[-1]]) - envelope.time[[0, -1]]  # half a window at either end
    ends = envelope.difference[[0, -1]] + beyond * envelope.difference_speed[[0, -1]]
    amplitude = np.abs(np.append(envelope.difference, ends))
    by_periods = abs(value.per_ratio) / 1e-7 * float(np.hypot(*seen.period_relative_uncertainty))
    least_decay = max(_DECAY, 5.0 * estimate.sigma)  # frequency and damping rate have the same standard deviation
    raised = {
        "beats-through-zero": passes_zero(amplitude),
        "short-record": float(seen.time[-1]) < SHORT_SECONDS,
        "frequency-difference-unresolved": by_periods > value.noise,
        "gravity-implausible": not IMPLAUSIBLE[0] < value.gravity < IMPLAUSIBLE[1],
        DAMPING_ASSUMED: seen.damping_rate is None and estimate.damping_rate > least_decay,
        "acceleration-not-reduced": _accelerated(prepared, estimate, value),
        "correction-without-uncertainty": any(
            entry.applied and not entry.stated and abs(entry.value) > value.noise for entry in value.given.values()
        ),
        **_noise(prepared, estimate),
    }
    return [name for name in OF_GRAVITY if raised.get(name)]


def _accelerated(prepared: Prepared, estimate: Estimate, value: Gravity) -> bool:
    """Browne's `<x''^2>/(2 g)` with x'' = -g psi, against sigma; only where the pendulums are taken for real ones."""
    if estimate.acceleration_reduced:
        return False
    if prepared.observation.restoring != "sine" and estimate.finite_arc == 0.0:
        return False
    size = 0.5 * value.gravity * prepared.slow_square / MGAL
    return size > max(value.noise, LEAST_BROWNE)


def _noise(prepared: Prepared, estimate: Estimate) -> dict[str, bool]:
    stated = prepared.observation.sigma_difference
    allowance = 5.0 / np.sqrt(2.0 * estimate.samples)  # of the estimate itself
    found = estimate.noise if stated is None else estimate.noise / stated
    return {
        "noise-above-stated": stated is not None and found > NOISE_ABOVE + allowance,
        "noise-below-stated": stated is not None and found < NOISE_BELOW - allowance,
        "residual-not-white": structured(prepared, estimate),
    }
