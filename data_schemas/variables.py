"""The one table of every variable a file may hold: dimensions, number type, unit, meaning and allowed range.

A key is ``group/name`` (``record/elongation``); a variable of the root has its bare name (``time``). The rows are lines
of variables_record.txt, variables_truth.txt and variables_result.txt (see `_rows`); a new variable is one line. Those
of a summary, one an input and method, stand at the root of its file and under ``summary/`` here.
"""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import variables_truth

if TYPE_CHECKING:
    import xarray as xr


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
    limit: Literal["positive", "not negative"] | None = None  # what physics allows
    missing: bool = False  # whether NaN (a missing value) is allowed; infinite values never are


FLAGS = "gap saturated interpolated time_mark ambiguous lost overlap single_direction outlier"  # of elongations
ELONGATION_FLAGS = {flag: 1 << bit for bit, flag in enumerate(FLAGS.split())}
_ROW = re.compile(r"(\w+)\((.*?)\) (.*?)(?: \[(.*?)\])?: (.*)")
_RULES: dict[str, dict[str, Any]] = {
    "required": {"required": True},
    "missing": {"missing": True},
    "positive": {"limit": "positive"},
    "nonnegative": {"limit": "not negative"},
}
_MASKS = np.array(list(ELONGATION_FLAGS.values()), dtype=np.uint16)  # CF 3.5: of its type
_TYPES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "text": ("str", "1", {}),
    "u1": ("u1", "1", {}),
    "flags": ("u2", "1", {"flag_masks": _MASKS, "flag_meanings": FLAGS}),
    "epoch": ("f8", "seconds since 2000-01-01T00:00:00Z", {"calendar": "standard"}),
}  # Words in place of a unit: number type, unit, further attributes


def _rows(text: str) -> dict[str, dict[str, Variable]]:
    """Rows by group and name, of lines ``name(dimensions | others) unit [rules]: meaning`` below lines ``[group]``.

    Units may be "text", "u1" (a code), "flags" or "epoch"; rules, with commas: keys of `_RULES`, "cf STANDARD_NAME".
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


def _uncertainty(row: Variable) -> Variable:
    """Standard deviation of a constant; one a variable of time has a single one."""
    units, also = row.units.partition("_")[0], tuple(dims for dims in row.also if dims != ("time",))
    meaning = f"standard deviation of the {row.long_name}"
    return replace(row, units=units, also=also, long_name=meaning, limit="not negative", standard_name=None)


_TIME = "time(time) epoch [required, cf time]: time of the sample, from the start of the record"
_RECORD, _RESULT = (Path(__file__).with_name(f"variables_{kind}.txt") for kind in ("record", "result"))
_TABLES = (_TIME, _RECORD.read_text(encoding="utf-8"), variables_truth.TABLE, _RESULT.read_text(encoding="utf-8"))
_GROUPS = _rows("\n".join(_TABLES))
_GROUPS[""]["time"] = replace(_GROUPS[""]["time"], attrs={"calendar": "standard", "axis": "T"})
_GROUPS["instrument"] |= {
    f"{name}_uncertainty": _uncertainty(row) for name, row in _GROUPS["instrument"].items() if row.dtype == "f8"
}
_ROWS = {f"{group}/{name}".lstrip("/"): row for group, rows in _GROUPS.items() for name, row in rows.items()}
VARIABLES: Mapping[str, Variable] = MappingProxyType(_ROWS)


def rows_of(group: str) -> Mapping[str, Variable]:
    """Rows of a group, or of the root, by the name within it."""
    return _GROUPS.get(group, {})


def add_constant(name: str, units: str, long_name: str) -> None:
    """Add a number of /instrument, and its standard deviation, to the table: a correction of one's own may need it."""
    for own, meaning in ((name, long_name), (f"{name}_uncertainty", f"standard deviation of {name}")):
        row = _ROWS.setdefault(f"instrument/{own}", Variable((), "f8", units, meaning))
        _GROUPS["instrument"].setdefault(own, row)


def attributes(key: str) -> dict[str, Any]:
    """Attributes of a variable ``group/name`` for memory: ``units``, ``long_name`` and what CF asks beside them.

    The dictionary is yours to change: set the epoch in ``units`` of ``time``. `KeyError`: not in the table.
    """
    row = VARIABLES[key]
    named = {} if row.standard_name is None else {"standard_name": row.standard_name}
    return {"units": row.units, "long_name": row.long_name, **named, **row.attrs}


def dataset(
    group: str, values: Mapping[str, Any], coordinates: Mapping[str, Any] = MappingProxyType({}),
    extra: Mapping[str, tuple[str, str]] = MappingProxyType({}), dims: tuple[str, ...] = (),
) -> "xr.Dataset":  # fmt: skip
    """A group of a file, units and meanings from the table or from `extra`, whose values have the dimensions `dims`."""
    import xarray as xr

    def entry(name: str, value: Any) -> "xr.Variable":
        text = isinstance(value, str) or (isinstance(value, list) and bool(value) and isinstance(value[0], str))
        data = np.asarray(value, dtype=object if text else None)
        if name in extra:
            units, long_name = extra[name]
            return xr.Variable(dims, data, {"units": units, "long_name": long_name}, fastpath=True)
        row = VARIABLES[f"{group}/{name}"]
        own = next((each for each in (row.dims, *row.also) if len(each) == data.ndim), row.dims)
        return xr.Variable(own, data, attributes(f"{group}/{name}"), fastpath=True)

    labels = {
        name: value if isinstance(value, np.ndarray) else np.array(list(value), dtype=object)
        for name, value in coordinates.items()
    }
    return xr.Dataset(*({name: entry(name, value) for name, value in each.items()} for each in (values, labels)))


_SPELLINGS = """
rad radian radians, s sec second seconds, m meter metre meters metres, K kelvin Kelvin, kg kilogram kilograms, day d,
degrees degree deg, degrees_north degree_north degree_N degrees_N, degrees_east degree_east degree_E degrees_E,
mGal milligal
"""
_MEANING = {spelling: unit for unit, *others in map(str.split, _SPELLINGS.split(",")) for spelling in others}
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
    """Whether a unit as found in a file means the unit of the table; a unit of time matches with any epoch."""
    if not isinstance(given, str):
        # a dimensionless unit is written by some as the number 1
        return wanted == "1" and given == 1
    text = given.strip()
    if " since " in wanted:
        return _SINCE.fullmatch(text) is not None
    return text == wanted or (len(text) < 40 and _powers(text) == _powers(wanted) is not None)
