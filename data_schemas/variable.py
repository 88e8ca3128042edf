"""One row of the table of variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Limit = Literal["positive", "not negative"]


@dataclass(frozen=True)
class Variable:
    """What a variable must be."""

    dims: tuple[str, ...]
    """Its dimensions, in order; () for a scalar."""
    dtype: str
    """Number type in memory and on disk; "str" is variable-length UTF-8."""
    units: str
    long_name: str
    """As attached to the variable; "1" for counts, labels and ratios."""
    standard_name: str | None = None
    """Only where the CF table has a name that means exactly this."""
    required: bool = False
    """Whether its group is incomplete without it."""
    attrs: Mapping[str, Any] = field(default_factory=dict)
    """Further attributes (calendar, flag_masks and the like)."""
    also: tuple[tuple[str, ...], ...] = ()
    """Other dimensions that are accepted."""
    limit: Limit | None = None
    """What physics allows."""
    missing: bool = False
    """Whether NaN (a missing value) is allowed. Infinite values never are."""
