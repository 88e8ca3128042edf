"""One row of the table of variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Limit = Literal["positive", "not negative"]


@dataclass(frozen=True)
class Variable:
    """What a variable must be.

    Attributes
    ----------
    dims : tuple of str
        Its dimensions, in order; () for a scalar.
    dtype : {"f8", "u2", "u1", "i8", "str"}
        Number type in memory and on disk; "str" is variable-length UTF-8.
    units, long_name : str
        As attached to the variable; "1" for counts, labels and ratios.
    standard_name : str or None
        Only where the CF table has a name that means exactly this.
    required : bool
        Whether its group is incomplete without it.
    attrs : mapping
        Further attributes (calendar, flag_masks and the like).
    also : tuple of tuple of str
        Other dimensions that are accepted.
    limit : {"positive", "not negative"} or None
        What physics allows.
    missing : bool
        Whether NaN (a missing value) is allowed. Infinite values never are.
    """

    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    standard_name: str | None = None
    required: bool = False
    attrs: Mapping[str, Any] = field(default_factory=dict)
    also: tuple[tuple[str, ...], ...] = ()
    limit: Limit | None = None
    missing: bool = False
