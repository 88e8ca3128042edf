"""What only a record, or only a result, can have wrong: its labels, its combination, what it needs for gravity."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .contents import Contents, Entry, key, shown, type_name
from .variables import rows_of

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


def _entry(contents: Contents, path: str, name: str, dims: tuple[str, ...] = (), dtype: str = "") -> Entry | None:
    """A variable, if it is there; of some dimensions and type, whose faults are reported elsewhere otherwise."""
    entry = contents[path].variables.get(name) if path in contents else None
    if entry is None or (dtype and (entry.dims != dims or type_name(entry.values) != dtype)):
        return None
    return entry


def _labels(contents: Contents, path: str, name: str) -> list[str] | None:
    entry = _entry(contents, path, name, (name,), "str")
    return None if entry is None else entry.values.tolist()


def result_faults(contents: Contents) -> Iterator[str]:
    """Faults of a result beyond the table's: labels that appear twice."""
    for path, name in (
        ("phases", "component"),
        ("correction", "estimator"),
        ("gravity", "estimator"),
        ("gravity", "entry"),
        ("synchrony", "clock"),
        ("synchrony", "pair"),
    ):
        labels = _labels(contents, path, name) or []
        if len(set(labels)) < len(labels):
            yield f"{path}/{name}: a label appears twice; give each its own"


@np.errstate(all="ignore")
def record_faults(contents: Contents, sizes: dict[tuple[str, str], int]) -> list[str]:
    """Faults of a record beyond the table's, given the length of each (group, dimension)."""
    if "record" not in contents:
        return []
    trace = _entry(contents, "record", "trace")
    combination = _entry(contents, "record", "combination", ("trace", "pendulum"), "f8")
    elongation = _entry(contents, "record", "elongation", ("trace", "time"), "f8")
    return [
        *_label_faults(contents),
        *_absurd_values(contents),
        *([] if combination is None else _combination_faults(combination.values, trace)),
        *([] if elongation is None else _empty_traces(elongation.values, trace)),
        *(_needed_for_gravity(contents) if sizes.get(("record", "trace"), 1) > 1 else []),
        *_unknown_constants(contents),
        *_word_faults(contents),
    ]


def _label_faults(contents: Contents) -> Iterator[str]:
    for path, name in (("record", "trace"), ("record", "pendulum"), ("instrument", "pendulum")):
        labels = _labels(contents, path, name)
        if labels is None:
            continue
        if not labels:
            yield f"{path}/{name}: holds no label; give at least one {name}"
        if len(set(labels)) < len(labels):
            yield f"{path}/{name}: a label appears twice; give each {name} its own"
        wrong = [shown(repr(each)) for each in labels if not each.isprintable() or not 0 < len(each) <= MOST_LABEL]
        yield from (f"{path}/{name}: {each} is no label; give 1 to {MOST_LABEL} printable letters" for each in wrong)
    recorded, described = _labels(contents, "record", "pendulum"), _labels(contents, "instrument", "pendulum")
    if recorded is not None and described is not None:
        absent = ", ".join(shown(label) for label in recorded if label not in described)
        if absent:
            yield f"instrument/pendulum: lacks {absent} of record/pendulum; use the same labels in both"


def _combination_faults(combination: NDArray[Any], trace: Entry | None) -> list[str]:
    if not np.isfinite(combination).all():
        return []  # the table's check says so
    if max(combination.shape) > MOST_TRACES:
        return [f"record/combination: more than {MOST_TRACES} traces or pendulums; split the record"]
    zero = np.flatnonzero(~combination.any(axis=1)).tolist()
    if zero or min(combination.shape) < 2 or _gives_difference(combination):
        told = "is all zero; say which pendulums it records"
        return [f"record/combination: the row of trace {_label(trace, row)} {told}" for row in zero]
    return [
        "record/combination: no pair of pendulums can be told apart from these traces; record one pendulum and "
        "its difference with another, or both, or give a single trace"
    ]


def _gives_difference(combination: NDArray[Any]) -> bool:
    """Whether some pendulum i and some difference i - j are both combinations of the traces.

    Then so are i and j themselves: two pendulums must be recoverable, that is two unit vectors lie in the row
    space.
    """
    # the projector on the row space: pendulum i is recoverable when it leaves the unit vector i as it is
    projector = np.linalg.pinv(combination) @ combination
    return bool((np.abs(np.diag(projector) - 1.0) < 1e-9).sum() >= 2)


def _empty_traces(elongation: NDArray[Any], trace: Entry | None) -> list[str]:
    empty = np.flatnonzero(np.isnan(elongation).all(axis=1)).tolist() if elongation.shape[1] else []
    return [f"record/elongation: trace {_label(trace, row)} is all NaN; leave the trace out" for row in empty]


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
            yield (
                f"time: {time.values.size} readings {step:.3g} s apart, as a rule, reach over {span:.3g} s; split the "
                "record at its gaps"
            )


def _unknown_constants(contents: Contents) -> Iterator[str]:
    known = rows_of("instrument")
    for name in contents["instrument"].variables if "instrument" in contents else {}:
        if name not in known:
            (near,) = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
            yield f"instrument/{shown(name)}: is not known, the nearest is {near}; use that name, or leave it out"


def _needed_for_gravity(contents: Contents) -> Iterator[str]:
    wanted = {"period": "the full period of each pendulum in s", "reference_gravity": "the gravity at which it holds"}
    for name, meaning in wanted.items():
        if _entry(contents, "instrument", name) is None:
            yield f"instrument/{name}: is missing; give {meaning} (only a record of a single trace can do without)"


def _word_faults(contents: Contents) -> Iterator[str]:
    for (path, name), words in WORDS.items():
        word = contents[path].attrs.get(name, words[0]) if path in contents else words[0]
        if not isinstance(word, str) or word not in words:
            yield f"{path}, attribute {name}: is {shown(repr(word))}; give '{words[0]}' or '{words[1]}'"
