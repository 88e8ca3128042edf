"""Whether a propagator's own estimate of its error can be believed: within 10 times below, and not 1000 times above."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from pipeline.benchmarks.work_precision import Point

UNDER = 10.0
"""The true error may be so many times the estimate."""
OVER = 1000.0
"""The estimate may be so many times the true error."""
EXACT = 1e-15
"""An estimate of a few roundings is not asked to be met from below: an error may vanish by chance."""


def honest(error: float, estimate: float) -> bool:
    """Whether an estimate fits the true error; NaN fits nothing."""
    return error <= UNDER * estimate and (error >= estimate / OVER or estimate <= EXACT)


def judged(points: Sequence[Point]) -> Iterator[dict[str, Any]]:
    """One row for each point at which one of the project's propagators gave a value."""
    for point in points:
        if point.own and point.seconds and not math.isnan(point.estimate):
            yield {
                "honesty": point.problem,
                "method": point.method,
                "tolerance": point.tolerance,
                "error": point.whole_error,
                "estimate": point.estimate,
                "error_over_estimate": point.whole_error / point.estimate,
                "pass": honest(point.whole_error, point.estimate),
            }
