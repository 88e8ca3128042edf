"""One method on one prepared record: its gravity, or why it refused."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.estimate import Estimate
from pipeline.flags import flags
from pipeline.gravity import Gravity, gravity
from pipeline.methods import method
from pipeline.prepared import CAPTURE, Prepared

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
