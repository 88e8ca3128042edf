"""What every part of a scene shares: frozen sections, quantities with unit and range, exact rationals."""

from __future__ import annotations

from fractions import Fraction
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, PlainValidator, WithJsonSchema


class Section(BaseModel):
    """A part of a scene: immutable, no key beyond the named ones, no infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def quantity(default: Any, unit: str, description: str, *, resistance: str = "", **limits: Any) -> Any:
    """Field of a scene; `default=...` makes it required.

    Parameters
    ----------
    default
        Value when the key is left out.
    unit
        Unit of the numbers, "1" for pure numbers, "" for words and lists of sections.
    description
        Meaning, one sentence.
    resistance
        Name of the resistance to the swing that the field brings; `synth.systems.resistance` has its kernels.
    limits
        Range, as pydantic knows it: gt, ge, lt, le, min_length, pattern.
    """
    words: dict[str, Any] = {"unit": unit} | ({"resistance": resistance} if resistance else {})
    return Field(default, description=description, json_schema_extra=words, **limits)


def extra(section: type[Section], name: str) -> dict[str, str]:
    """Unit of a field, and the name of the resistance that it brings."""
    words = section.model_fields[name].json_schema_extra
    return {key: str(value) for key, value in words.items()} if isinstance(words, dict) else {}


Number = Annotated[float, Field(strict=True)]
Count = Annotated[int, Field(strict=True)]
Switch = Annotated[bool, Field(strict=True)]
Label = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9_.+-]{1,16}$")]
TraceName = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9_.+-]{1,40}$")]


def _rational(value: object) -> Fraction:
    """Read 25, 12.5 or "25/3" as the decimal or ratio that was written, not as its nearest double."""
    if isinstance(value, Fraction):
        number = value
    elif isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError("must be a number or a ratio of integers such as 25, 12.5 or '25/3'")
    else:
        try:
            number = Fraction(str(value))
        except (ValueError, ZeroDivisionError):
            raise ValueError("must be a number or a ratio of integers such as 25, 12.5 or '25/3'") from None
    if not 0 < number <= 100_000:
        raise ValueError("must be above 0 and at most 100000")
    if number.denominator > 10**12:
        raise ValueError("must be a ratio of integers below 1e12")
    return number


Rational = Annotated[
    Fraction,
    PlainValidator(_rational),
    PlainSerializer(str, return_type=str),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "exclusiveMinimum": 0, "maximum": 100_000},
                {"type": "string", "pattern": r"^[0-9]+(\.[0-9]+)?(/[0-9]+)?$"},
            ]
        }
    ),
]
