"""What a film's description holds beside constants: occupations of base stations, and readings taken while it ran.

Both are made of the table of the record's instrument: a quantity that the record may hold is one that the description
may state.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import Field, create_model

from data_schemas.scene_fields import Number, Section, quantity
from data_schemas.variables_record import INSTRUMENT

BASE, PENDULUM, TIME = "base", "pendulum", "time"
LIMITS: dict[str | None, dict[str, float]] = {None: {}, "positive": {"gt": 0}, "not negative": {"ge": 0}}

Name = Annotated[str, Field(strict=True, min_length=1)]  # records of other programs name as they like


def of_instrument(*dims: str, also: tuple[str, ...] | None = None) -> list[str]:
    """Names of the instrument's numbers of some dimensions; with `also`, those that may have other dimensions too."""
    return [
        name
        for name, row in INSTRUMENT.items()
        if row.dims == dims and row.dtype == "f8" and (also is None or also in row.also)
    ]


def fields(*dims: str) -> dict[str, Any]:
    """Fields for the instrument's numbers of some dimensions, none of them required."""
    return {name: _number(name, False) for name in of_instrument(*dims)}


def _number(name: str, required: bool) -> Any:
    """Field for a variable of the instrument."""
    row = INSTRUMENT[name]
    kind = Number if required else Number | None
    return kind, quantity(... if required else None, row.units, row.long_name, **dict[str, Any](LIMITS[row.limit]))


def _each(name: str, required: bool) -> Any:
    """Field for a variable of the instrument that every pendulum has."""
    row = INSTRUMENT[name]
    each = Annotated[float, Field(strict=True, **LIMITS[row.limit])]
    kind = dict[str, each] if required else dict[str, each] | None
    return kind, quantity(... if required else None, row.units, f"{row.long_name}, of each pendulum by label")


BASES = {name: of_base for name in of_instrument(BASE) if (of_base := name.removeprefix("base_"))}
"""Variables of the instrument with a value a base, and their keys."""

PERIODS = {name: name.removeprefix("base_") for name in of_instrument(BASE, PENDULUM)}
"""Those with a value a base and pendulum, and their keys."""

COURSES = of_instrument(also=(TIME,))
"""Those that may be read again and again while the film runs."""


class _NamedBase(Section):
    label: Name = quantity(..., "", "name of the station")


def _of_base() -> dict[str, Any]:
    own = {key: _number(name, not name.endswith("_uncertainty")) for name, key in BASES.items()}
    return own | {key: _each(name, not name.endswith("_uncertainty")) for name, key in PERIODS.items()}


DescribedBase: Any = create_model(
    "DescribedBase",
    __base__=_NamedBase,
    __doc__="An occupation of a base station, before or after the record.",
    **_of_base(),
)


class _TimedReading(Section):
    time: Number = quantity(..., "s", "when, in the record's seconds")


DescribedReading: Any = create_model(
    "DescribedReading",
    __base__=_TimedReading,
    __doc__="Conditions as they were read at some time; between readings they are taken to change evenly.",
    **{name: _number(name, False) for name in COURSES},
)


def check_bases(bases: Iterable[Any], labels: list[str]) -> None:
    """Raise ValueError where bases state different things, or other pendulums than there are."""
    bases = list(bases)
    names = [base.label for base in bases]
    if len(set(names)) < len(names):
        raise ValueError("bases must have different labels; name each occupation for itself")
    for key in (*BASES.values(), *PERIODS.values()):
        given = [getattr(base, key) is not None for base in bases]
        if any(given) and not all(given):
            raise ValueError(f"{key} is stated of {sum(given)} of {len(given)} bases; state it of all or of none")
    for base in bases:
        for key in PERIODS.values():
            stated = getattr(base, key)
            if stated is not None and set(stated) != set(labels):
                raise ValueError(
                    f"base {base.label!r} states {key} of {', '.join(stated)}; the pendulums are {', '.join(labels)}"
                )


def check_readings(readings: Iterable[Any], instrument: Any) -> None:
    """Raise ValueError where readings are out of order, hold nothing, or repeat what the instrument states."""
    times = [reading.time for reading in readings]
    if any(later <= earlier for earlier, later in itertools.pairwise(times)):
        raise ValueError("readings must be in order of time")
    for name in COURSES:
        given = [getattr(reading, name) is not None for reading in readings]
        if any(given) and getattr(instrument, name) is not None:
            raise ValueError(f"{name} is stated in instrument and in readings; leave one of them out")
    if any(all(getattr(reading, name) is None for name in COURSES) for reading in readings):
        raise ValueError(f"a reading must hold {' or '.join(COURSES)}")
