"""One method on one prepared record: its gravity, or why it refused."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.estimate import Estimate
from pipeline.flags import LINEAR_FITS, UNDECIDED, flags
from pipeline.gaps import require_bridges
from pipeline.gravity import Gravity, gravity
from pipeline.methods import method
from pipeline.outliers import MOST_ANGLE
from pipeline.prepared import CAPTURE, Prepared

if TYPE_CHECKING:
    from pipeline.sensors.examination import Examination


@dataclass(frozen=True)
class Reduction:
    """Outcome of one method; `estimate` and `gravity` are None when it refused."""

    requested: str
    method: str
    reason: str
    estimate: Estimate | None
    gravity: Gravity | None
    flags: tuple[str, ...]
    error: str
    elapsed: float


def reduce_by(name: str, prepared: Prepared, gain_uncertainty: float, sensors: Examination | None = None) -> Reduction:
    """Run a method (`auto` chooses one) and complete it with gravity and flags; `sensors` is what led to `prepared`."""
    started = time.perf_counter()
    chosen, reason, doubt, undecided = name, "", 0.0, False
    try:
        if name == "auto":
            from pipeline.choice import choose

            choice = choose(prepared)
            chosen, reason, doubt, undecided = choice.method, choice.reason, choice.doubt, choice.undecided
        if chosen != "projection":
            require_bridges(prepared.long_gaps, prepared.whole_step)
        estimate = method(chosen)(prepared)
        unsure = float(np.hypot(doubt, 0.0 if sensors is None else sensors.doubt))
        seen = prepared.observation
        if estimate.acceleration_reduced and seen.vertical is not None:  # dn/n = dg/2g
            unsure = float(np.hypot(unsure, 0.5 * estimate.frequency * seen.vertical_doubt / seen.reference_gravity))
        if unsure:
            estimate = replace(estimate, sigma=float(np.hypot(estimate.sigma, unsure)))
        _require_capture(estimate, prepared)
    except RefusedError as refusal:
        elapsed = time.perf_counter() - started
        return Reduction(name, chosen, reason, None, None, (), str(refusal), elapsed)
    value = gravity(estimate, prepared, gain_uncertainty)
    found = (*((UNDECIDED,) if undecided else ()), *(sensors.flags if sensors else ()))
    raised = tuple(dict.fromkeys([*flags(prepared, estimate, value), *found]))
    if name == "shooting" and _linear_fits(prepared, estimate):
        raised = (*raised, LINEAR_FITS)
    return Reduction(name, chosen, reason, estimate, value, raised, "", time.perf_counter() - started)


def _linear_fits(prepared: Prepared, real: Estimate) -> bool:
    """Whether linear pendulums explain the record better, where heave told from the phase feigns what arcs would do.

    Of sparse readings, which hide a third harmonic, it is asked too.
    """
    seen = prepared.observation
    sparse = seen.step is None or seen.step * prepared.nominal > MOST_ANGLE
    if seen.restoring is not None or not (sparse or real.heave is not None):
        return False
    from pipeline.choice import choose

    return choose(prepared).method == "projection"


def _require_capture(estimate: Estimate, prepared: Prepared) -> None:
    departure = estimate.frequency / prepared.nominal - 1.0
    if not np.isfinite(departure) or abs(departure) > CAPTURE:
        raise RefusedError(
            f"instrument/period: the swing found departs by {100 * departure:.1f} % from the stated period; "
            "check the period and the time axis"
        )
