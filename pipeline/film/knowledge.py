"""What is known of a film before it is read: its description, what the user says instead, and the instrument."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from data_schemas.errors import RecordError, UsageError
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
from pipeline.film.parts import Floats, Marking, TimeAxis
from pipeline.film.scan.opening import MM_PER_INCH
from pipeline.importing.record import by_number, combine, need_period_and_gravity, periods_by_label

ASSUMED_LEVER = 2000.0  # mm rad-1; historic levers were found in no source
_FACTOR = 5.0  # mm: a swing wrong by a factor of e counts as a place wrong by this
NOTHING = FilmDescription.model_construct(traces=(), pendulums=())  # of a film of which nothing is described
READINGS = ("auto", "continuous", "strobe")


@dataclass(frozen=True)
class FilmOptions:
    """What the user says of a film; it stands before the description. None and empty: as described."""

    lever: float | None = None  # optical lever of all traces, mm rad-1
    mark_interval: float | None = None  # time between marks, s
    marks: str | None = None  # what the shutter does at a full minute: "double", "long", "omitted" or "none"
    speed: float | None = None  # nominal, mm s-1
    dpi: float | None = None  # pixels per inch
    traces: Sequence[str] = ()  # NAME or NAME:COMBINATION, such as "upper:1-2", from the left to the right at rest
    combinations: Mapping[str, str] = field(default_factory=dict)  # of traces whose names do not say their pendulums
    periods: Mapping[str, float] = field(default_factory=dict)  # full, of each pendulum, s; "" means the only one
    gravity: float | None = None  # at which the periods hold, m s-2
    orientation: str = "auto"  # how the image is to be taken; see `open_scan`
    lines: str = "auto"
    reading: str = "auto"  # "continuous" between the marks, where the film is fast enough, or "strobe" at them alone
    rate: float | None = None  # samples a second between the marks; None: 10 to 25, as the film's rows support

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
        """The pendulums of some traces as described; `UsageError`: a period is said of one that none shows."""
        labels = sorted({label for trace in traces for label in trace.combination}, key=by_number)
        periods = periods_by_label(self.options.periods, labels)
        described = {each.label: each for each in self.description.pendulums}
        found = [described.get(label, DescribedPendulum(label=label)) for label in labels]
        return tuple(
            each.model_copy(update={"period": periods[each.label]}) if each.label in periods else each for each in found
        )

    def instrument(
        self, pendulums: Sequence[Any], time: Floats, found: Mapping[str, float | None], *, needed: bool
    ) -> xr.Dataset | None:
        """The group /instrument of a record; None where nothing is known of it nor needed.

        `time` (samples,) is the record's, s; `found`: 1 sigma that the reading adds to constants, None where to none.
        `UsageError`: `needed` for gravity, and no periods are known.
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
        if needed:
            unknown = [str(each.label) for each in pendulums if each.period is None]
            remedy = ", or say with --trace what the traces are"
            need_period_and_gravity(unknown, values.get("reference_gravity"), remedy)
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
        for name, sigma in found.items():
            if sigma is not None and not (name == "delay_uncertainty" and name in values):
                values[name] = np.hypot(values.get(name, 0.0), sigma)
        if "chronometer_rate_uncertainty" in values:
            values.setdefault("chronometer_rate", 0.0)
        instrument = dataset("instrument", values, names)
        if self.states("restoring"):
            instrument.attrs["restoring"] = known.restoring
        return instrument

    def as_described(self, column: Floats, scale: float) -> tuple[tuple[DescribedTrace, ...], list[int], Floats]:
        """Described traces, for each the number of the one found, and where those rest, (found,) px; see `match`."""
        numbers = (str(k + 1) for k in range(len(column)))  # of traces of which nothing is known, from the left
        traces = self.traces or tuple(DescribedTrace(name=own, combination={own: 1.0}) for own in numbers)
        filled = np.where(np.isfinite(column).any(axis=1, keepdims=True), column, 0.0)
        rest, swing = np.nanmean(filled, axis=1), np.sqrt(2.0) * np.nanstd(filled, axis=1)
        return traces, match(traces, rest * scale, swing * scale), rest


def match(described: Sequence[DescribedTrace], rest: Floats, swing: Floats) -> list[int]:
    """For each described trace the one found, by rest and swing (found,) mm; `RecordError`: not as many were found."""
    from scipy.optimize import linear_sum_assignment

    if rest.size != len(described):
        names = ", ".join(trace.name for trace in described)
        shown = {0: "no trace was", 1: "1 trace was"}.get(rest.size, f"{rest.size} traces were")
        raise RecordError(
            f"{shown} found on the film, but {len(described)} described ({names}); say which are there with --trace"
        )
    if any(trace.position is None for trace in described):
        return [int(k) for k in np.argsort(rest, kind="stable")]
    cost = np.square(rest - np.array([[trace.position] for trace in described], dtype=np.float64))
    for row, trace in zip(cost, described, strict=True):
        if trace.amplitude is not None:
            row += np.square(_FACTOR * np.log(np.where(swing > 0.0, swing, trace.amplitude) / trace.amplitude))
    return [int(k) for k in linear_sum_assignment(cost)[1]]


def film_scale(stated: float | None, speed: float | None, axis: TimeAxis) -> tuple[float, str | None]:
    """Size of a pixel, mm, stated or by the speed, mm s-1, and what is believed for it; `RecordError`: neither."""
    if stated is not None:
        return stated, None
    rate = axis.rows_per_second
    if speed is None or not np.isfinite(rate):
        raise RecordError("the image says no resolution, which elongations need; give --dpi, or the film's --speed")
    dpi = MM_PER_INCH * rate / speed
    return speed / rate, f"the image says no resolution; the marks at {speed:g} mm/s give {dpi:.4g} dpi"
