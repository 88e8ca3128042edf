"""What every part of a scene shares: frozen sections, quantities with unit and range, faults in one line."""

import difflib
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, PlainValidator, ValidationError, WithJsonSchema

from data_schemas.errors import IsochronyError
from data_schemas.text_files import load_toml

_LONGEST_VALUE = 60
_TYPE_NAMES = frozenset({"float", "int", "str", "constrained-int", "constrained-str"})  # pydantic's, within a location
_MOST_FAULTS = 8  # further ones are counted, so that a scene of another kind gives a line and not a page


class Section(BaseModel):
    """A part of a scene: immutable, no key beyond the named ones, no infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def quantity(default: Any, unit: str, description: str, **limits: Any) -> Any:
    """Field of a scene; `default=...` makes it required; `limits` are a range as pydantic knows it.

    `unit` is "1" for pure numbers, "" for words and lists of sections.
    """
    return Field(default, description=description, json_schema_extra={"unit": unit}, **limits)


def extra(section: type[Section], name: str) -> dict[str, str]:
    """What a field says of itself beyond its range and meaning: its ``unit``."""
    words = section.model_fields[name].json_schema_extra
    return {key: str(value) for key, value in words.items()} if isinstance(words, dict) else {}


def refuse(wrong: object, message: str) -> None:
    """Raise ValueError with a message where something is wrong."""
    if wrong:
        raise ValueError(message)


def check_distinct(names: Iterable[str], message: str) -> None:
    """Raise ValueError with a message where two names are alike."""
    names = list(names)
    refuse(len(set(names)) < len(names), message)


def check_known(names: Iterable[str], known: Iterable[str], what: str) -> None:
    """Raise ValueError where a section names something, `what` in words, that does not exist."""
    for name in names:
        if name not in known:
            raise ValueError(f"{what} {name!r}; there are {', '.join(known)}")


Number = Annotated[float, Field(strict=True)]
Count = Annotated[int, Field(strict=True)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**63)]
Text = Annotated[str, Field(strict=True)]
Name = Annotated[str, Field(strict=True, min_length=1)]  # records of other programs name as they like
Switch = Annotated[bool, Field(strict=True)]
Label = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9_.+-]{1,16}$")]
TraceName = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9_.+-]{1,40}$")]


def _rational(value: object) -> Fraction:
    """Read 25, 12.5 or "25/3" as the decimal or ratio that was written, not as its nearest double."""
    try:
        number = Fraction(str(value))  # also of a Fraction; "True" and the like are none
    except (ValueError, ZeroDivisionError):
        raise ValueError("must be a number or a ratio of integers such as 25, 12.5 or '25/3'") from None
    if not 0 < number <= 100_000:
        raise ValueError("must be above 0 and at most 100000")
    if number.denominator > 10**12:
        raise ValueError("must be a ratio of integers below 1e12")
    return number


_NUMBER_SCHEMA = {"type": "number", "exclusiveMinimum": 0, "maximum": 100_000}
_RATIO_SCHEMA = {"type": "string", "pattern": r"^[0-9]+(\.[0-9]+)?(/[0-9]+)?$"}
Rational = Annotated[
    Fraction,
    PlainValidator(_rational),
    PlainSerializer(str, return_type=str),
    WithJsonSchema({"anyOf": [_NUMBER_SCHEMA, _RATIO_SCHEMA]}),
]


_Kind = TypeVar("_Kind", bound=Section)


def load_section(
    path: str | os.PathLike[str], kind: type[_Kind], what: str, fault: type[IsochronyError],
    unread: type[IsochronyError] | None = None, context: Mapping[str, Any] | None = None,
) -> _Kind:  # fmt: skip
    """Read a section of its own from a TOML file that should hold `what` ("a scene").

    Errors in one line: `fault`, every faulty key; `unread` (else `fault`), a file that cannot be read, or is not TOML.
    """
    content = load_toml(path, what, unread or fault)
    try:
        return kind.model_validate(content, context=context)
    except ValidationError as error:
        raise fault(f"{os.fspath(path)}: {one_line(error, kind)}") from None


def one_line(error: ValidationError, model: type[Section]) -> str:
    """Every fault that pydantic found in a section, separated by semicolons, without a line break."""
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
            near = difflib.get_close_matches(str(fault["loc"][-1]), known, n=1, cutoff=0.0)
            return f"{key} = {value} is not a known key; did you mean {near[0]!r}?"
        case "missing":
            return f"{key} is missing; give it"
        case "union_tag_not_found":
            return f"{key}.kind is missing; give it"
        case "union_tag_invalid":
            tag, kinds = fault["ctx"]["tag"], fault["ctx"]["expected_tags"]
            near = difflib.get_close_matches(tag, re.findall("'(.*?)'", kinds), n=1, cutoff=0.0)
            return f"{key}.kind = {tag!r} is none of {kinds}; did you mean {near[0]!r}?"
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
        elif not (_TYPE_NAMES & {step} or "[" in step or "(" in step):  # anything a file may hold, a line break too
            words.append(_shortened(step if step.isprintable() else repr(step)))
    return ".".join(words), list(section.model_fields) if section is not None else []


def _sections(annotation: Any) -> Iterator[type[Section]]:
    """Yield every section that an annotation names, through unions, tuples and Annotated."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    for part in get_args(annotation):
        yield from _sections(part)
