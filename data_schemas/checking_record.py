"""What only a record, or only a result, can have wrong: its labels, its combination, what it needs for gravity."""

from __future__ import annotations

import difflib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .contents import Contents, Entry, key, shown, type_name
from .variables import VARIABLES

ABSURD = (
    ("", "time", 0.0, 1e12, "s"),
    ("record", "elongation", 0.0, 1e5, "rad"),
    ("record", "combination", 0.0, 1e6, "1"),
    ("record", "vertical_acceleration", 0.0, 1e5, "m s-2"),
    ("record", "horizontal_acceleration", 0.0, 1e5, "m s-2"),
    ("instrument", "period", 1e-3, 1e4, "s"),
    ("instrument", "reference_gravity", 1e-6, 1e8, "m s-2"),
    ("instrument", "damping_rate", 0.0, 1e4, "s-1"),
)
"""Group, name, least and largest size, unit."""
MOST_LABEL = 64
MOST_TRACES = 500
MOST_SPAN = 20.0  # times the time that the readings take
WORDS = {
    ("instrument", "restoring"): ("sine", "linear"),
    ("instrument", "acceleration_frame"): ("earth", "case"),
    ("record", "reference"): ("vertical", "case"),
}
"""What an attribute of a group may say, the default first."""


@np.errstate(all="ignore")
def record_faults(contents: Contents, sizes: dict[tuple[str, str], int]) -> list[str]:
    """Faults of a record beyond the table's.

    Parameters
    ----------
    contents : Contents
    sizes : mapping of (group, dimension) to int
    """
    if "record" not in contents:
        return []
    record = contents["record"].variables
    found = _label_faults(contents) + _absurd_values(contents)
    combination = _numbers(record.get("combination"), ("trace", "pendulum"))
    if combination is not None:
        found += _combination_faults(combination, record.get("trace"))
    elongation = _numbers(record.get("elongation"), ("trace", "time"))
    if elongation is not None:
        found += _empty_traces(elongation, record.get("trace"))
    if sizes.get(("record", "trace"), 1) > 1:
        found += _needed_for_gravity(contents)
    found += _unknown_constants(contents)
    for (path, name), words in WORDS.items():
        word = contents[path].attrs.get(name, words[0]) if path in contents else words[0]
        if not isinstance(word, str) or word not in words:
            found.append(f"{path}, attribute {name}: is {shown(repr(word))}; give '{words[0]}' or '{words[1]}'")
    return found


def result_faults(contents: Contents) -> list[str]:
    """Faults of a result beyond the table's: labels that appear twice."""
    found = []
    for path, name in (
        ("phases", "component"),
        ("correction", "estimator"),
        ("gravity", "estimator"),
        ("gravity", "entry"),
        ("synchrony", "clock"),
        ("synchrony", "pair"),
    ):
        labels = _labels(contents, path, name)
        if labels is not None and len(set(labels)) < len(labels):
            found.append(f"{path}/{name}: a label appears twice; give each its own")
    return found


def _numbers(entry: Entry | None, dims: tuple[str, ...]) -> NDArray[Any] | None:
    """Values of a variable that is what it should be; its faults are told elsewhere otherwise."""
    if entry is None or entry.dims != dims or type_name(entry.values) != "f8":
        return None
    return entry.values


def _labels(contents: Contents, path: str, name: str) -> list[str] | None:
    entry = contents[path].variables.get(name) if path in contents else None
    if entry is None or entry.dims != (name,) or type_name(entry.values) != "str":
        return None
    labels: list[str] = entry.values.tolist()
    return labels


def _label_faults(contents: Contents) -> list[str]:
    found = []
    for path, name in (("record", "trace"), ("record", "pendulum"), ("instrument", "pendulum")):
        labels = _labels(contents, path, name)
        if labels is None:
            continue
        if not labels:
            found.append(f"{path}/{name}: holds no label; give at least one {name}")
        if len(set(labels)) < len(labels):
            found.append(f"{path}/{name}: a label appears twice; give each {name} its own")
        wrong = [shown(repr(each)) for each in labels if not each.isprintable() or not 0 < len(each) <= MOST_LABEL]
        found += [f"{path}/{name}: {each} is no label; give 1 to {MOST_LABEL} printable letters" for each in wrong]
    recorded, described = _labels(contents, "record", "pendulum"), _labels(contents, "instrument", "pendulum")
    if recorded is not None and described is not None:
        absent = [shown(label) for label in recorded if label not in described]
        if absent:
            found.append(
                f"instrument/pendulum: lacks {', '.join(absent)} of record/pendulum; use the same labels in both"
            )
    return found


def _combination_faults(combination: NDArray[Any], trace: Entry | None) -> list[str]:
    if not np.isfinite(combination).all():
        return []  # the table's check says so
    if max(combination.shape) > MOST_TRACES:
        return [f"record/combination: more than {MOST_TRACES} traces or pendulums; split the record"]
    found = [
        f"record/combination: the row of trace {_label(trace, row)} is all zero; say which pendulums it records"
        for row in np.flatnonzero(~combination.any(axis=1)).tolist()
    ]
    traces, pendulums = combination.shape
    if traces > 1 and pendulums > 1 and not found and not _gives_difference(combination):
        found.append(
            "record/combination: no pair of pendulums can be told apart from these traces; record one pendulum and "
            "its difference with another, or both, or give a single trace"
        )
    return found


def _gives_difference(combination: NDArray[Any]) -> bool:
    """Whether some pendulum i and some difference i - j are both combinations of the traces.

    Then so are i and j themselves: two pendulums must be recoverable, that is two unit vectors lie in the row
    space.
    """
    # the projector on the row space: pendulum i is recoverable when it leaves the unit vector i as it is
    projector = np.linalg.pinv(combination) @ combination
    return bool((np.abs(np.diag(projector) - 1.0) < 1e-9).sum() >= 2)


def _empty_traces(elongation: NDArray[Any], trace: Entry | None) -> list[str]:
    if not elongation.shape[1]:
        return []
    empty = np.flatnonzero(np.isnan(elongation).all(axis=1)).tolist()
    return [f"record/elongation: trace {_label(trace, row)} is all NaN; leave the trace out" for row in empty]


def _label(trace: Entry | None, row: int) -> str:
    if trace is not None and trace.values.ndim == 1 and row < trace.values.size:
        return shown(repr(str(trace.values[row])))
    return f"number {row + 1}"


def _absurd_values(contents: Contents) -> list[str]:
    """Numbers that no pendulum has: arithmetic would end in infinities, or in more memory than there is."""
    found = []
    for path, name, least, most, unit in ABSURD:
        entry = contents[path].variables.get(name) if path in contents else None
        if entry is None or entry.values.dtype.kind != "f":
            continue
        size = np.abs(entry.values[np.isfinite(entry.values)], dtype=np.float64)
        if not size.size:
            continue
        low, high = float(size.min()), float(size.max())
        if high > most or low < least:
            told = high if high > most else low
            found.append(
                f"{key(path, name)}: {told:.3g} is no value in {unit}; correct it, its scale_factor or its unit"
            )
    time = contents[""].variables.get("time")
    if time is not None and time.dims == ("time",) and time.values.dtype.kind == "f" and time.values.size > 2:
        step, span = float(np.median(np.diff(time.values))), float(time.values[-1] - time.values[0])
        if span > MOST_SPAN * step * time.values.size:
            found.append(
                f"time: {time.values.size} readings {step:.3g} s apart, as a rule, reach over {span:.3g} s; split the "
                "record at its gaps"
            )
    return found


def _unknown_constants(contents: Contents) -> list[str]:
    known = [name.partition("/")[2] for name in VARIABLES if name.startswith("instrument/")]
    names = contents["instrument"].variables if "instrument" in contents else {}
    return [
        f"instrument/{shown(name)}: is not known, the nearest is {near}; use that name, or leave it out"
        for name in names
        if name not in known
        for near in difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    ]


def _needed_for_gravity(contents: Contents) -> list[str]:
    known = contents["instrument"].variables if "instrument" in contents else {}
    wanted = {"period": "the full period of each pendulum in s", "reference_gravity": "the gravity at which it holds"}
    return [
        f"instrument/{name}: is missing; give {meaning} (only a record of a single trace can do without)"
        for name, meaning in wanted.items()
        if name not in known
    ]
