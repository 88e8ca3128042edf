"""One row of the table of variables; which spellings of its unit mean the same, as other programs write records too."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

Limit = Literal["positive", "not negative"]
_FLAGS = "gap saturated interpolated time_mark ambiguous lost overlap single_direction outlier"
ELONGATION_FLAGS = {flag: 1 << bit for bit, flag in enumerate(_FLAGS.split())}


@dataclass(frozen=True)
class Variable:
    """What a variable must be."""

    dims: tuple[str, ...]  # in order; () for a scalar
    dtype: str  # number type in memory and on disk; "str" is variable-length UTF-8
    units: str  # as attached to the variable; "1" for counts, labels and ratios
    long_name: str
    standard_name: str | None = None  # only where the CF table has a name that means exactly this
    required: bool = False  # whether its group is incomplete without it
    attrs: Mapping[str, Any] = field(default_factory=dict)  # further ones: calendar, flag_masks and the like
    also: tuple[tuple[str, ...], ...] = ()  # other dimensions that are accepted
    limit: Limit | None = None  # what physics allows
    missing: bool = False  # whether NaN (a missing value) is allowed; infinite values never are


_ROW = re.compile(r"(\w+)\((.*?)\) (.*?)(?: \[(.*?)\])?: (.*)")
_RULES: dict[str, dict[str, Any]] = {
    "required": {"required": True},
    "missing": {"missing": True},
    "positive": {"limit": "positive"},
    "nonnegative": {"limit": "not negative"},
}
_MASKS = np.array(list(ELONGATION_FLAGS.values()), dtype=np.uint16)  # of the variable's own type (CF 3.5)
_TYPES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "text": ("str", "1", {}),
    "u1": ("u1", "1", {}),
    "flags": ("u2", "1", {"flag_masks": _MASKS, "flag_meanings": _FLAGS}),
    "epoch": ("f8", "seconds since 2000-01-01T00:00:00Z", {"calendar": "standard"}),
}  # Words in place of a unit: number type, unit, further attributes


def tables(text: str) -> dict[str, dict[str, Variable]]:
    """Rows by group and name, of lines ``name(dimensions | others) unit [rules]: meaning`` below lines ``[group]``.

    In place of a unit "text", "u1" (a code), "flags" or "epoch". Rules, with commas: "required", "missing",
    "positive", "nonnegative", and "cf NAME", its standard name.
    """
    groups: dict[str, dict[str, Variable]] = {}
    group = ""
    for line in text.split("\n"):
        if line.startswith("["):
            group = line.strip("[]")
        elif line:
            found = _ROW.fullmatch(line)
            if found is None:
                raise ValueError(f"{line!r} is no row of a table of variables")
            name, places, unit, given, meaning = found.groups("")
            dims, *also = (tuple(re.findall(r"\w+", place)) for place in places.split("|"))
            dtype, units, attrs = _TYPES.get(unit, ("f8", unit, {}))
            rules: dict[str, Any] = {}
            for rule in filter(None, given.split(", ")):
                rules |= {"standard_name": rule[3:]} if rule.startswith("cf ") else _RULES[rule]
            row = Variable(dims, dtype, units, meaning, attrs=attrs, also=tuple(also), **rules)
            groups.setdefault(group, {})[name] = row
    return groups


_SPELLINGS = {
    "rad": "radian radians",
    "s": "sec second seconds",
    "m": "meter metre meters metres",
    "K": "kelvin Kelvin",
    "kg": "kilogram kilograms",
    "day": "d",
    "degrees": "degree deg",
    "degrees_north": "degree_north degree_N degrees_N",
    "degrees_east": "degree_east degree_E degrees_E",
    "mGal": "milligal",
}
_MEANING = {spelling: unit for unit, others in _SPELLINGS.items() for spelling in others.split()}
_FACTOR = re.compile(r"(/|per )?([A-Za-z_]+|1\b)(?:\^|\*\*)?(-?\d+)?[ .]?")
_SINCE = re.compile(r"(?:s|sec|second|seconds) since [-+]?\d{1,4}-\d{1,2}-\d{1,2}(?:[T ].*)?")


def _powers(unit: str) -> Counter[str] | None:
    """Power of each unit in a product of powers; None if it is no such product."""
    if "".join(each[0] for each in _FACTOR.finditer(unit)) != unit:
        return None
    powers: Counter[str] = Counter()
    for under, name, power in _FACTOR.findall(unit):
        one, sign = ("s", -1) if name == "Hz" else (_MEANING.get(name, name), 1)
        powers[one] += sign * (-1 if under else 1) * int(power or 1)
    del powers["1"], powers["dimensionless"]
    return powers


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
    return text == wanted or (len(text) < 40 and _powers(text) == _powers(wanted) is not None)
