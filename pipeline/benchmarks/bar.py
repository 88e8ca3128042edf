"""One row of the suite `bars`: what was promised, what was measured, what the limit is, whether it holds."""

from __future__ import annotations

import math

from pipeline.benchmarks.tables import Row


def at_most(bar: str, value: float, limit: float, unit: str = "") -> Row:
    """A bar that holds where the value is not above the limit; NaN never holds."""
    return _row(bar, value, f"<= {limit:.4g}", unit, value <= limit)


def at_least(bar: str, value: float, limit: float, unit: str = "") -> Row:
    """A bar that holds where the value is not below the limit."""
    return _row(bar, value, f">= {limit:.4g}", unit, value >= limit)


def between(bar: str, value: float, low: float, high: float, unit: str = "") -> Row:
    """A bar with two limits."""
    return _row(bar, value, f"{low:.4g} to {high:.4g}", unit, low <= value <= high)


def holds(bar: str, fact: bool, limit: str) -> Row:
    """A bar that is a fact or not."""
    return _row(bar, 1.0 if fact else 0.0, limit, "", fact)


def reported(bar: str, value: float, unit: str = "") -> Row:
    """A figure beside a bar, which promises nothing and decides nothing."""
    return _row(bar, value, "reported", unit, None)


def not_measured(bar: str, limit: str, why: str) -> Row:
    """A bar that cannot be judged here, such as a peer that is not installed; it decides nothing."""
    return _row(bar, math.nan, limit, why, None)


def of_few(limit: float, count: int, full: int) -> float:
    """A limit on a ratio of root mean squares from fewer records than the promise names.

    The scatter of such a ratio is 1/sqrt(2 count); the limit grows by three times what it gains over the full count.

    >>> of_few(1.1, 400, 400)
    1.1
    """
    return limit * (1.0 + 3.0 * max(math.sqrt(0.5 / count) - math.sqrt(0.5 / full), 0.0))


def _row(bar: str, value: float, limit: str, unit: str, passed: bool | None) -> Row:
    return {
        "bar": bar,
        "value": float(value),
        "limit": limit,
        "unit": unit,
        "pass": None if passed is None else bool(passed),
    }
