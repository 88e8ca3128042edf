"""What is known of a film before it is read: its description, what the user says instead, and the instrument."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.film_description import (
    BASE,
    BASES,
    COURSES,
    PENDULUM,
    PERIODS,
    DescribedPendulum,
    DescribedTrace,
    FilmDescription,
)
from data_schemas.variables import dataset
from pipeline.film.parts import Floats, Marking
from pipeline.importing.record import combine, periods_by_label

if TYPE_CHECKING:
    import xarray as xr

ASSUMED_LEVER = 2000.0  # mm rad-1; historic levers were found in no source
NOTHING = FilmDescription.model_construct(traces=(), pendulums=())
"""The description of a film of which nothing is described."""


READINGS = ("auto", "continuous", "strobe")


@dataclass(frozen=True)
class FilmOptions:
    """What the user says of a film; it stands before the description. None and empty: as described.

    Attributes
    ----------
    lever : float or None
        Optical lever of all traces, mm rad-1.
    mark_interval : float or None
        Time between marks, s.
    marks : str or None
        What the shutter does at a full minute: "double", "long", "omitted" or "none".
    speed : float or None
        Nominal speed, mm s-1.
    dpi : float or None
        Pixels per inch.
    traces : sequence of str
        NAME or NAME:COMBINATION, such as "upper:1-2", from the left to the right at rest.
    combinations : mapping of str to str
        Pendulums of a trace, where its name does not say them.
    periods : mapping of str to float
        Full period of each pendulum, s; the key "" means the only one.
    gravity : float or None
        Gravity at which the periods hold, m s-2.
    orientation, lines : str
        How the image is to be taken; see `pipeline.film.scan.ScanOptions`.
    reading : {"auto", "continuous", "strobe"}
        Between the marks, or at the marks alone; auto takes the first where the film is fast enough.
    rate : float or None
        Samples a second between the marks; the highest of 25, 20, 12.5 and 10 that the film's rows support.
    """

    lever: float | None = None
    mark_interval: float | None = None
    marks: str | None = None
    speed: float | None = None
    dpi: float | None = None
    traces: Sequence[str] = ()
    combinations: Mapping[str, str] = field(default_factory=dict)
    periods: Mapping[str, float] = field(default_factory=dict)
    gravity: float | None = None
    orientation: str = "auto"
    lines: str = "auto"
    reading: str = "auto"
    rate: float | None = None

    def __post_init__(self) -> None:
        if self.reading not in READINGS:
            raise UsageError(f"reading '{self.reading}': give one of {', '.join(READINGS)}")


class Known:
    """All that is known of a film: description (`NOTHING` where it has none), options, speed (mm s-1), dpi."""

    def __init__(self, description: FilmDescription | None = None, options: FilmOptions | None = None) -> None:
        self.description, self.options = description or NOTHING, options or FilmOptions()
        self.speed = self.options.speed or self.description.speed
        self.dpi = self.options.dpi or self.description.dpi

    def states(self, name: str) -> bool:
        """Whether the description itself states an entry."""
        return name in self.description.model_fields_set

    @property
    def traces(self) -> tuple[DescribedTrace, ...]:
        """Traces as the user names or the description lists them, empty where neither does."""
        if not self.options.traces:
            return self.description.traces
        names: list[str] = []
        combinations: dict[str, str] = {}
        for text in self.options.traces:
            name, colon, combination = text.partition(":")
            if not name or (colon and not combination):
                raise UsageError(f"--trace {text}: write it as NAME or NAME:COMBINATION, such as upper:1-2")
            if name in names:
                raise UsageError(f"--trace names '{name}' twice; give each trace once")
            names.append(name)
            combinations |= {name: combination} if colon else {}
        combinations |= self.options.combinations
        labels, matrix = combine(names, combinations)
        described = {trace.name: trace for trace in self.description.traces}
        found = []
        for name, row in zip(names, matrix, strict=True):
            known: dict[str, Any] = described[name].model_dump() if name in described else {"name": name}
            if name not in described or name in combinations:
                known["combination"] = {each: float(weight) for each, weight in zip(labels, row, strict=True) if weight}
            found.append(DescribedTrace.model_validate(known))
        return tuple(found)

    @property
    def count(self) -> int | None:
        """Number of traces; None where neither user nor description names them."""
        return len(self.traces) or None

    def lever(self, trace: DescribedTrace) -> float:
        """Optical lever of a trace, mm rad-1."""
        return self.options.lever or trace.lever or ASSUMED_LEVER

    def assumptions(self, traces: Sequence[DescribedTrace]) -> list[str]:
        """What was neither described nor said and had to be assumed, one sentence each."""
        said = []
        if self.options.lever is None and any(trace.lever is None for trace in traces):
            said.append(f"an optical lever of {ASSUMED_LEVER:g} mm/rad is assumed (--lever says otherwise)")
        if self.options.mark_interval is None and not self.states("mark_interval"):
            interval = self.description.mark_interval
            said.append(f"marks every {interval:g} s are assumed (--mark-interval says otherwise)")
        return said

    def marking(self, scale: float | None, directed: bool = False) -> Marking:
        """What is known of the marks of a film of `scale` mm a pixel; `directed`: the user said how time runs."""
        known = self.description
        return Marking(
            interval=known.mark_interval if self.options.mark_interval is None else self.options.mark_interval,
            gap=known.gap,
            minute_code=known.minute_code,
            speed=None if scale is None or self.speed is None else self.speed / scale,
            code=self.options.marks or known.marks,
            kind=known.mark_kind,
            directed=directed,
        )

    def pendulums(self, traces: Sequence[DescribedTrace]) -> tuple[Any, ...]:
        """The pendulums of some traces, with their periods and what else is described of them.

        `UsageError`: a period is said of a pendulum that no trace shows.
        """
        labels = list({label for trace in traces for label in trace.combination})
        labels.sort(key=lambda label: (not label.isdigit(), int(label) if label.isdigit() else 0, label))
        periods = periods_by_label(self.options.periods, labels)
        described = {each.label: each for each in self.description.pendulums}
        found = [described.get(label, DescribedPendulum(label=label)) for label in labels]
        return tuple(
            each.model_copy(update={"period": periods[each.label]}) if each.label in periods else each for each in found
        )

    def instrument(
        self, pendulums: Sequence[Any], time: Floats, clock: float | None, scale: float | None, *, needed: bool
    ) -> xr.Dataset | None:
        """The group /instrument of a record; None where nothing is known of it nor needed.

        `pendulums` are those of the traces in the record's order, `time` (samples,) is the record's, s. `clock` is by
        how much the film's time axis may run wrong, s a day: that of the times alone, in which the samples' uncertainty
        has no part, nor it in theirs, so that gravity counts each once. `scale` is by how much, relative, all
        elongations may be wrong. `needed`: gravity is to be had.

        `UsageError`: it is, and periods or their gravity are not known.
        """
        known, labels = self.description, [str(each.label) for each in pendulums]
        values = {key: value for key, value in known.instrument.model_dump().items() if value is not None}
        for name in COURSES:  # straight between readings, the first before them and the last after
            read = [(each.time, getattr(each, name)) for each in known.readings if getattr(each, name) is not None]
            if read:
                values[name] = np.interp(time, *np.array(read, dtype=np.float64).T)
        for key in DescribedPendulum.model_fields:
            stated = [getattr(each, key) for each in pendulums]
            if key != "label" and None not in stated:
                values[key] = np.array(stated, dtype=np.float64)
        if self.options.gravity is not None:
            values["reference_gravity"] = self.options.gravity
        unknown = [each.label for each in pendulums if each.period is None] if needed else []
        if unknown:
            raise UsageError(
                f"pendulum {unknown[0]} has no period, which gravity needs; add --period {unknown[0]}=SECONDS, "
                "or say with --trace what the traces are"
            )
        if needed and "reference_gravity" not in values:
            raise UsageError("the gravity at which the periods hold is missing; add --gravity, in m/s2")
        names = {PENDULUM: labels}
        if known.bases:
            names[BASE] = [base.label for base in known.bases]
            for name, key in (BASES | PERIODS).items():
                stated = [getattr(base, key) for base in known.bases]
                if None not in stated:
                    each_one = [[each[label] for label in labels] for each in stated] if name in PERIODS else stated
                    values[name] = np.array(each_one, dtype=np.float64)
        if not values:
            return None
        if clock is not None:
            values.setdefault("chronometer_rate", 0.0)
            stated_sigma = values.get("chronometer_rate_uncertainty", 0.0)
            values["chronometer_rate_uncertainty"] = float(np.hypot(stated_sigma, clock))
        if scale is not None:
            values["scale_uncertainty"] = scale
        instrument = dataset("instrument", values, names)
        if self.states("restoring"):
            instrument.attrs["restoring"] = known.restoring
        return instrument


def default_traces(count: int) -> tuple[DescribedTrace, ...]:
    """Traces of which nothing is known: each a pendulum of its own, numbered from the left."""
    return tuple(DescribedTrace(name=str(k), combination={str(k): 1.0}) for k in range(1, count + 1))
