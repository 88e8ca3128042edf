"""Checks a content, or a whole file, against the layout of its kind and names every fault at once."""

import difflib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .contents import IDENTIFIER, Contents, Entry, from_tree, key, shown, type_name
from .errors import FileError, RecordError, SceneError
from .layouts import LAYOUTS, Kind
from .reading import load
from .variables import VARIABLES, Variable, rows_of, same_unit

if TYPE_CHECKING:
    import xarray as xr


LIKE = 0.85  # of a name, from which it is a misprint of a known one
ABSURD = (
    ("", "time", 0.0, 1e12, "s"),
    ("record", "elongation", 0.0, 1e5, "rad"),
    ("record", "combination", 0.0, 1e6, "1"),
    ("record", "vertical_acceleration", 0.0, 1e5, "m s-2"),
    ("record", "horizontal_acceleration", 0.0, 1e5, "m s-2"),
    ("instrument", "period", 1e-3, 1e4, "s"),
    ("instrument", "reference_gravity", 1e-6, 1e8, "m s-2"),
    ("instrument", "damping_rate", 0.0, 1e4, "s-1"),
)  # Group, name, least and largest size, unit: arithmetic on others would end in infinities, or exhaust the memory
MOST_LABEL = 64
MOST_TRACES = 500
MOST_SPAN = 20.0  # times the time that the samples take
WORDS = {
    ("instrument", "restoring"): ("sine", "linear"),
    ("instrument", "acceleration_frame"): ("earth", "case"),
    ("record", "reference"): ("vertical", "case"),
}  # What an attribute of a group may say, the default first
_NEEDED = {"period": "the full period of each pendulum in s", "reference_gravity": "the gravity at which it holds"}
_LABELS = frozenset({"trace", "pendulum", "component", "estimator", "entry", "clock", "pair"})  # none twice


def check(tree: "xr.DataTree", schema: Kind) -> list[str]:
    """Every fault of a tree in memory, one line each, ``group/name: what is wrong; what to do``; empty for a good one.

    `schema` is what it is meant to be: record, truth, result, film-truth or summary.
    """
    try:
        return faults(from_tree(tree), schema)
    except FileError as error:
        return [str(error)]


def checked(tree: "xr.DataTree", schema: Kind) -> Contents:
    """The content of a good tree; `RecordError` with every fault of another."""
    try:
        contents = from_tree(tree)
    except FileError as error:
        raise RecordError(str(error)) from None
    if found := faults(contents, schema):
        raise RecordError("; ".join(found))
    return contents


def validate(path: str | os.PathLike[str]) -> list[str]:
    """Every fault of a file at once, one line each, ``path: group/name: what is wrong; what to do``.

    By its suffix ``.toml`` it is a scene, the description of a film or edits of one; else a record, truth or result.
    Bad content never raises.
    """
    try:
        if Path(path).suffix == ".toml":
            from . import film_description, film_edits
            from .scene import load_scene
            from .text_files import load_toml

            match load_toml(path, "a scene", SceneError).get("kind"):  # a scene has none
                case film_description.KIND:
                    film_description.load_description(path)
                case film_edits.KIND:
                    film_edits.load_edits(path)
                case _:
                    load_scene(path)
            return []
        contents = load(path)
    except (SceneError, RecordError, FileError) as error:
        return [str(error)]
    kind, found = _kind(contents)
    found += [] if kind is None else faults(contents, kind)
    return [f"{shown(path, 400)}: {fault}" for fault in dict.fromkeys(found)]


def _kind(contents: Contents) -> tuple[Kind | None, list[str]]:
    """What the file says it is, or failing that looks like, with the fault of not saying it well."""
    schema = contents[""].attrs.get("schema")
    named = [kind for kind, layout in LAYOUTS.items() if isinstance(schema, str) and schema == layout.schema]
    alike = [kind for kind, layout in LAYOUTS.items() if not layout.groups.keys().isdisjoint(contents)]
    if named or alike:
        return (named or alike)[0], []  # the check of what is alike says what is wrong with the attribute
    known = ", ".join(layout.schema for layout in LAYOUTS.values())
    stated = "is missing at the root" if schema is None else f"is {shown(repr(schema))}"
    return None, [f"attribute schema: {stated} and no group is known; set it to one of {known}"]


def faults(contents: Contents, schema: Kind) -> list[str]:
    """Every fault of a plain content; `check` and `validate` share it."""
    layout = LAYOUTS[schema]
    found = [*_attribute_faults(contents[""].attrs, schema)]
    for path, required in layout.groups.items():
        if path in contents:
            found += _missing_variables(contents, path, path)
        elif required:
            found.append(f"{path}: the group is missing; add it with its variables")
    if layout.one_of and not any(path in contents for path in layout.one_of):
        found.append(f"{' or '.join(layout.one_of)}: the group is missing; add one of them")
    if layout.root:
        found += _missing_variables(contents, "", layout.root)
    elif "time" not in contents[""].variables:
        found.append("time: is missing at the root; add the time of each sample, float64 seconds")
    sizes = _sizes(contents, found)
    for path, group in contents.items():
        for name, entry in group.variables.items():
            found += _variable_faults(key(path, name), entry, schema)
            if name in _LABELS and entry.dims == (name,) and type_name(entry.values) == "str":
                found += _label_faults(key(path, name), entry.values.tolist(), schema)
    found += _time_faults(contents)
    if schema == "record" and "record" in contents:
        with np.errstate(all="ignore"):
            found += _record_faults(contents, sizes)
    return found


def _attribute_faults(attrs: dict[str, Any], schema: Kind) -> Iterator[str]:
    layout = LAYOUTS[schema]
    for name, required in layout.attrs.items():
        if name not in attrs and required:
            yield f"attribute {name}: is missing at the root; add it"
    own = attrs.get("record_id")
    if own is not None and not (isinstance(own, str) and IDENTIFIER.fullmatch(own)):
        yield f"attribute record_id: {shown(repr(own))} is no identifier; give 1 to 64 of A-Z a-z 0-9 . _ + -"
    for name, wanted, remedy in (
        ("schema", layout.schema, f" if this is a {schema}"),
        ("schema_version", layout.version, ", or use a newer isochrony"),
    ):
        given = attrs.get(name, wanted)
        if not isinstance(given, str) or given != wanted:
            yield f"attribute {name}: is {shown(repr(given))}, not {wanted!r}; set it to {wanted!r}{remedy}"
    for name in layout.json_attrs:
        try:
            json.loads(attrs.get(name, "{}"))
        except (TypeError, ValueError):
            yield f"attribute {name}: is not JSON; store the text of a JSON object"


def _missing_variables(contents: Contents, path: str, table: str) -> Iterator[str]:
    for name, row in rows_of(table).items():
        if row.required and name not in contents[path].variables:
            dims = ", ".join(row.dims)
            yield f"{key(path, name)}: the variable is missing; add it with dimensions ({dims}) in {row.units}"


def _sizes(contents: Contents, found: list[str]) -> dict[tuple[str, str], int]:
    """Length of each dimension in each group; a group whose lengths differ from its own or the root's is a fault."""
    sizes: dict[tuple[str, str], int] = {}
    for path in sorted(contents):
        for name, entry in contents[path].variables.items():
            for dim, length in zip(entry.dims, entry.values.shape, strict=True):
                known, where = sizes.setdefault((path, dim), sizes.get(("", dim), length)), key(path, name)
                if length != known:
                    told = f"{where}: has {length} values along {shown(dim)} where others have {known}"
                    found.append(f"{told}; make the dimension {shown(dim)} of one length")
    return sizes


def _variable_faults(where: str, entry: Entry, schema: Kind) -> Iterator[str]:
    row = VARIABLES.get(where if "/" in where else key(LAYOUTS[schema].root, where))
    if row is None:
        if schema == "result":
            missing = (name for name in ("units", "long_name") if name not in entry.attrs)
            yield from (f"{shown(where)}: is not in the table and has no {name}; add it" for name in missing)
        return
    if entry.dims not in (row.dims, *row.also):
        wanted = " or ".join(f"({', '.join(dims)})" for dims in (row.dims, *row.also))
        yield f"{where}: has dimensions ({shown(', '.join(entry.dims))}); give it {wanted}"
    units = entry.attrs.get("units", "1" if row.units == "1" else None)
    if units is None:
        yield f"{where}: has no units; set its attribute units to {row.units!r}"
    elif not same_unit(units, row.units):
        yield f"{where}: has units {shown(repr(units))}; convert it to {row.units!r}"
    if type_name(entry.values) != row.dtype:
        yield f"{where}: has type {type_name(entry.values)}; store it as {row.dtype}"
        return
    for name in ("flag_masks", "flag_meanings"):
        if name in row.attrs and name in entry.attrs and not np.array_equal(row.attrs[name], entry.attrs[name]):
            wanted = " ".join(str(one) for one in np.atleast_1d(row.attrs[name]))
            yield f"{where}, attribute {name}: differs from the table; set it to {wanted}"
    if row.dtype == "f8" and entry.values.size and where != "time":
        yield from _value_faults(where, entry, row)


def _value_faults(where: str, entry: Entry, row: Variable) -> Iterator[str]:
    lowest, highest = np.fmin.reduce(entry.values, axis=None), np.fmax.reduce(entry.values, axis=None)
    if not row.missing and np.isnan(entry.values).any():
        yield f"{where}: holds NaN; give every value, or leave the variable out"
    if np.isinf(lowest) or np.isinf(highest):
        remedy = "mark missing values as NaN" if row.missing else "give finite values"
        yield f"{where}: holds infinite values; {remedy}"
    if (row.limit == "positive" and lowest <= 0) or (row.limit == "not negative" and lowest < 0):
        wanted = "greater than zero" if row.limit == "positive" else "zero or more"
        yield f"{where}: holds {lowest:g}; give values {wanted}"


def _time_faults(contents: Contents) -> Iterator[str]:
    time = contents[""].variables.get("time")
    if time is None or time.dims != ("time",) or type_name(time.values) != "f8":
        return
    values = time.values
    if values.size < 2:
        yield f"time: holds {values.size} sample{'s' * (values.size != 1)}; a record needs 2 or more"
    elif not np.isfinite(values).all():
        yield "time: holds NaN or infinite values; give every sample its time in seconds"
    elif (falls := np.flatnonzero(values[1:] <= values[:-1]) + 1).size:
        steps = f"{values[falls[0] - 1]:g} s, then {values[falls[0]]:g} s; {falls.size} such places"
        yield f"time: does not increase at sample {falls[0]} ({steps}); sort the samples and drop repeated ones"


def _label_faults(where: str, labels: list[str], schema: Kind) -> Iterator[str]:
    name = where.rpartition("/")[2]
    if len(set(labels)) < len(labels):
        yield f"{where}: a label appears twice; give each {name} its own"
    if schema != "record":
        return  # made of those of a record, and longer
    if not labels:
        yield f"{where}: holds no label; give at least one {name}"
    wrong = [shown(repr(each)) for each in labels if not each.isprintable() or not 0 < len(each) <= MOST_LABEL]
    yield from (f"{where}: {each} is no label; give 1 to {MOST_LABEL} printable letters" for each in wrong)


def _entry(contents: Contents, path: str, name: str, dims: tuple[str, ...] = (), dtype: str = "") -> Entry | None:
    """A variable, if it is there; of some dimensions and type, whose faults are reported elsewhere otherwise."""
    entry = contents[path].variables.get(name) if path in contents else None
    if entry is None or (dtype and (entry.dims != dims or type_name(entry.values) != dtype)):
        return None
    return entry


def _record_faults(contents: Contents, sizes: dict[tuple[str, str], int]) -> Iterator[str]:
    """What only a record can have wrong, given the length of each (group, dimension)."""
    pendulums = [_entry(contents, path, "pendulum", ("pendulum",), "str") for path in ("record", "instrument")]
    recorded, described = ([] if each is None else each.values.tolist() for each in pendulums)
    if absent := ", ".join(shown(label) for label in recorded if None not in pendulums and label not in described):
        yield f"instrument/pendulum: lacks {absent} of record/pendulum; use the same labels in both"
    yield from _absurd_values(contents)
    trace = _entry(contents, "record", "trace")
    combination = _entry(contents, "record", "combination", ("trace", "pendulum"), "f8")
    if combination is not None:
        yield from _combination_faults(combination.values, trace)
    elongation = _entry(contents, "record", "elongation", ("trace", "time"), "f8")
    if elongation is not None and elongation.values.shape[1]:
        for row in np.flatnonzero(np.isnan(elongation.values).all(axis=1)).tolist():
            yield f"record/elongation: trace {_label(trace, row)} is all NaN; leave the trace out"
    for name, meaning in _NEEDED.items() if sizes.get(("record", "trace"), 1) > 1 else ():
        if _entry(contents, "instrument", name) is None:
            yield f"instrument/{name}: is missing; give {meaning} (only a record of a single trace can do without)"
    for group, cutoff in (("instrument", 0.0), ("record", LIKE)):  # beside the readings what is one's own may stand
        known = rows_of(group)
        for name in contents[group].variables if group in contents else {}:
            if name in known:
                continue
            near = difflib.get_close_matches(name, known, n=1, cutoff=cutoff)
            if near:
                yield f"{group}/{shown(name)}: is not known, the nearest is {near[0]}; use that name, or leave it out"
    for (path, name), words in WORDS.items():
        word = contents[path].attrs.get(name, words[0]) if path in contents else words[0]
        if not isinstance(word, str) or word not in words:
            yield f"{path}, attribute {name}: is {shown(repr(word))}; give '{words[0]}' or '{words[1]}'"


def _combination_faults(combination: NDArray[Any], trace: Entry | None) -> Iterator[str]:
    if not np.isfinite(combination).all():
        return  # the table's check says so
    if max(combination.shape) > MOST_TRACES:
        yield f"record/combination: more than {MOST_TRACES} traces or pendulums; split the record"
        return
    zero = np.flatnonzero(~combination.any(axis=1)).tolist()
    for row in zero:
        yield f"record/combination: the row of trace {_label(trace, row)} is all zero; say which pendulums it records"
    if zero or min(combination.shape) < 2:
        return
    # two pendulums are recoverable where the projector on the row space leaves two unit vectors as they are
    projector = np.linalg.pinv(combination) @ combination
    if (np.abs(np.diag(projector) - 1.0) < 1e-9).sum() < 2:
        remedy = "record one pendulum and its difference with another, or both, or give a single trace"
        yield f"record/combination: no pair of pendulums can be told apart from these traces; {remedy}"


def _label(trace: Entry | None, row: int) -> str:
    if trace is not None and trace.values.ndim == 1 and row < trace.values.size:
        return shown(repr(str(trace.values[row])))
    return f"number {row + 1}"


def _absurd_values(contents: Contents) -> Iterator[str]:
    """Numbers that no pendulum has."""
    for path, name, least, most, unit in ABSURD:
        entry = _entry(contents, path, name)
        if entry is None or entry.values.dtype.kind != "f":
            continue
        size = np.abs(entry.values[np.isfinite(entry.values)], dtype=np.float64)
        low, high = float(size.min(initial=np.inf)), float(size.max(initial=0.0))
        if size.size and (high > most or low < least):
            odd = high if high > most else low
            yield f"{key(path, name)}: {odd:.3g} is no value in {unit}; correct it, its scale_factor or its unit"
    time = _entry(contents, "", "time", ("time",), "f8")
    if time is not None and time.values.size > 2:
        step, span = float(np.median(np.diff(time.values))), float(time.values[-1] - time.values[0])
        if span > MOST_SPAN * step * time.values.size:
            told = f"time: {time.values.size} readings {step:.3g} s apart, as a rule, reach over {span:.3g} s"
            yield f"{told}; split the record at its gaps"
