"""Faults of a scene in one line: dotted key, value, what is allowed, and the nearest known key."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic import ValidationError

from data_schemas.scene_fields import Section

_LONGEST_VALUE = 60
_MOST_FAULTS = 8  # further ones are counted, so that a scene of another kind gives a line and not a page


def one_line(error: ValidationError, model: type[Section]) -> str:
    """Say what is wrong with a scene.

    Parameters
    ----------
    error
        What pydantic found.
    model
        The section that was validated.

    Returns
    -------
    str
        Every fault, separated by semicolons, without a line break.
    """
    faults = error.errors(include_url=False)
    said = [_fault(fault, model) for fault in faults[:_MOST_FAULTS]]
    if len(faults) > _MOST_FAULTS:
        said.append(f"and {len(faults) - _MOST_FAULTS} more")
    return "; ".join(said)


def _fault(fault: Mapping[str, Any], model: type[Section]) -> str:
    key, known = _locate(fault["loc"], model)
    value = _shortened(repr(fault["input"]))
    match fault["type"]:
        case "extra_forbidden":
            name = str(fault["loc"][-1])
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
            return f"{key} = {value} is not a known key; did you mean {near[0]!r}?"
        case "missing":
            return f"{key} is missing; give it"
        case "union_tag_not_found":
            return f"{key}.kind is missing; give it"
        case "union_tag_invalid":
            context = fault["ctx"]
            near = difflib.get_close_matches(context["tag"], re.findall("'(.*?)'", context["expected_tags"]), 1, 0.0)
            known = context["expected_tags"]
            return f"{key}.kind = {context['tag']!r} is none of {known}; did you mean {near[0]!r}?"
    message = str(fault["msg"]).removeprefix("Value error, ").removeprefix("Input ")
    if isinstance(fault["input"], Mapping | Section):
        return f"{key + ': ' if key else ''}{message}"
    return f"{key} = {value}: {message}"


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def _locate(location: tuple[int | str, ...], model: type[Section]) -> tuple[str, list[str]]:
    """Dotted key of a fault, free of pydantic's own words, and the names known at its place."""
    words: list[str] = []
    section: type[Section] | None = model
    candidates: dict[str, type[Section]] = {}
    for step in location:
        if isinstance(step, int):
            words[-1] += f"[{step}]"
        elif step in candidates:  # the kind that pydantic chose, not a key
            section = candidates[step]
            candidates = {}
        elif section is not None and step in section.model_fields:
            words.append(step)
            found = list(_sections(section.model_fields[step].annotation))
            section = found[0] if len(found) == 1 else None
            candidates = {str(each.model_fields["kind"].default): each for each in found[1:] and found}
        elif _is_key(step):  # anything a file may hold, a line break too
            words.append(_shortened(step if step.isprintable() else repr(step)))
    return ".".join(words), list(section.model_fields) if section is not None else []


def _is_key(step: str) -> bool:
    """Tell a key of the file from pydantic's names of types, such as `constrained-int`."""
    return not any(mark in step for mark in "[(") and step not in {
        "float",
        "int",
        "str",
        "constrained-int",
        "constrained-str",
    }


def _sections(annotation: Any) -> Iterator[type[Section]]:
    """Yield every section that an annotation names, through unions, tuples and Annotated."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    for part in get_args(annotation):
        yield from _sections(part)
