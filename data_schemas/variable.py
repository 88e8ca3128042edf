"""One row of the table of variables; which spellings of its unit mean the same, as other programs write records too."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

Limit = Literal["positive", "not negative"]


@dataclass(frozen=True)
class Variable:
    """What a variable must be."""

    dims: tuple[str, ...]
    """Its dimensions, in order; () for a scalar."""
    dtype: str
    """Number type in memory and on disk; "str" is variable-length UTF-8."""
    units: str
    """As attached to the variable; "1" for counts, labels and ratios."""
    long_name: str
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


def f8(dims: str, units: str, long_name: str, rules: str = "", *, also: str | None = None, **more: Any) -> Variable:
    """Row of a number: dimensions apart by blanks; of the rules "required", "missing", "positive", "nonnegative"."""
    return _row("f8", dims, units, long_name, rules, also=() if also is None else (tuple(also.split()),), **more)


def text(dims: str, long_name: str, rules: str = "") -> Variable:
    """Row of labels or words."""
    return _row("str", dims, "1", long_name, rules)


def u1(dims: str, long_name: str, rules: str = "") -> Variable:
    """Row of codes."""
    return _row("u1", dims, "1", long_name, rules)


def u2(dims: str, long_name: str, flags: Mapping[str, int]) -> Variable:
    """Row of quality flags: ``flag_masks`` and ``flag_meanings``, the masks of the variable's own type (CF 3.5)."""
    masks = np.array(list(flags.values()), dtype=np.uint16)
    return _row("u2", dims, "1", long_name, attrs={"flag_masks": masks, "flag_meanings": " ".join(flags)})


def _row(dtype: str, dims: str, units: str, long_name: str, rules: str = "", **more: Any) -> Variable:
    words = set(rules.split())
    limit: Limit | None = "positive" if "positive" in words else "not negative" if "nonnegative" in words else None
    required, missing = "required" in words, "missing" in words
    own = tuple(dims.split())
    return Variable(own, dtype, units, long_name, required=required, limit=limit, missing=missing, **more)


_SPELLINGS = {
    "1": ("", "dimensionless"),
    "rad": ("radian", "radians"),
    "s": ("sec", "second", "seconds"),
    "m": ("meter", "metre", "meters", "metres"),
    "K": ("kelvin", "Kelvin"),
    "kg": ("kilogram", "kilograms"),
    "m s-2": ("m/s2", "m/s^2", "m s^-2", "m s**-2", "m/s**2", "m.s-2"),
    "m s-1": ("m/s", "m s^-1", "m s**-1", "m.s-1"),
    "s-1": ("1/s", "s^-1", "s**-1", "Hz"),
    "rad s-1": ("rad/s", "rad s^-1", "rad s**-1", "rad.s-1", "radian s-1", "radians per second"),
    "m2 s-4": ("m2/s4", "m^2/s^4", "m2 s^-4", "m**2 s**-4"),
    "rad2": ("rad^2", "rad**2"),
    "rad2 s": ("rad^2 s", "rad**2 s", "rad2/Hz", "rad^2/Hz"),
    "kg m-3": ("kg/m3", "kg/m^3", "kg m^-3", "kg m**-3"),
    "s day-1": ("s/day", "s d-1", "s/d"),
    "s K-1": ("s/K",),
    "N m-1": ("N/m",),
    "mm rad-1": ("mm/rad",),
    "mm s-1": ("mm/s",),
    "mm px-1": ("mm/px",),
    "degrees": ("degree", "deg"),
    "degrees_north": ("degree_north", "degree_N", "degrees_N"),
    "degrees_east": ("degree_east", "degree_E", "degrees_E"),
    "mGal": ("milligal",),
}
_MEANING = {spelling: unit for unit, others in _SPELLINGS.items() for spelling in (unit, *others)}
_SINCE = re.compile(r"(?:s|sec|second|seconds) since [-+]?\d{1,4}-\d{1,2}-\d{1,2}(?:[T ].*)?")


def same_unit(given: object, wanted: str) -> bool:
    """Whether a unit as found in a file means the unit of the table.

    A unit of time with an epoch matches any epoch.

    Examples
    --------
    >>> same_unit("m/s^2", "m s-2"), same_unit("deg", "rad")
    (True, False)
    >>> same_unit("seconds since 1958-07-01", "seconds since 2000-01-01")
    True
    """
    if not isinstance(given, str):
        # a dimensionless unit is written by some as the number 1
        return wanted == "1" and given == 1
    text = given.strip()
    if " since " in wanted:
        return _SINCE.fullmatch(text) is not None
    return _MEANING.get(text, text) == wanted
