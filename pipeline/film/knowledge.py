"""What is known of a film before it is read: its description, and what the user says beside or instead of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from data_schemas.errors import UsageError
from data_schemas.film_description import DescribedPendulum, DescribedTrace, FilmDescription
from pipeline.film.parts import Marking
from pipeline.importing.record import combine

ASSUMED_LEVER = 2000.0  # mm rad-1; historic levers were found in no source
DEFAULT_START = "2000-01-01T00:00:00Z"
ASSUMED_INTERVAL = 0.5  # s; half-second chronometers


@dataclass(frozen=True)
class FilmOptions:
    """What the user says of a film; it stands before the description.

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
        NAME or NAME:COMBINATION, such as "upper:1-2", from the left to the right at rest; empty: as described.
    combinations : mapping of str to str
        Pendulums of a trace, where its name does not say them.
    periods : mapping of str to float
        Full period of each pendulum, s; the key "" means the only one.
    gravity : float or None
        Gravity at which the periods hold, m s-2.
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


@dataclass(frozen=True)
class Known:
    """All that is known of a film, from its description and the user.

    Attributes
    ----------
    description : FilmDescription or None
    options : FilmOptions
    """

    description: FilmDescription | None = None
    options: FilmOptions = field(default_factory=FilmOptions)

    @property
    def mark_interval(self) -> float:
        """Time between marks, s."""
        if self.options.mark_interval is not None:
            return self.options.mark_interval
        return ASSUMED_INTERVAL if self.description is None else self.description.mark_interval

    @property
    def speed(self) -> float | None:
        """Nominal speed, mm s-1."""
        return self.options.speed or (None if self.description is None else self.description.speed)

    @property
    def dpi(self) -> float | None:
        """Pixels per inch."""
        return self.options.dpi or (None if self.description is None else self.description.dpi)

    @property
    def traces(self) -> tuple[DescribedTrace, ...]:
        """Traces as the user names or the description lists them, empty where neither does."""
        if not self.options.traces:
            return () if self.description is None else self.description.traces
        names, combinations = _split(self.options.traces)
        both = {**combinations, **self.options.combinations}
        pendulums, matrix = combine(names, both)
        described = {} if self.description is None else {trace.name: trace for trace in self.description.traces}
        return tuple(
            _named(name, row, pendulums, described, name in both) for name, row in zip(names, matrix, strict=True)
        )

    def lever(self, trace: DescribedTrace) -> float:
        """Optical lever of a trace, mm rad-1."""
        return self.options.lever or trace.lever or ASSUMED_LEVER

    def assumptions(self, traces: Sequence[DescribedTrace]) -> list[str]:
        """What was neither described nor said and had to be assumed, one sentence each."""
        said = []
        if self.options.lever is None and any(trace.lever is None for trace in traces):
            said.append(f"an optical lever of {ASSUMED_LEVER:g} mm/rad is assumed (--lever says otherwise)")
        described = self.description is not None and "mark_interval" in self.description.model_fields_set
        if self.options.mark_interval is None and not described:
            said.append(f"marks every {ASSUMED_INTERVAL:g} s are assumed (--mark-interval says otherwise)")
        return said

    def marking(self, scale: float | None, directed: bool = False) -> Marking:
        """What is known of the marks; `directed` whether the user said how time runs."""
        known = self.description
        return Marking(
            interval=self.mark_interval,
            gap=None if known is None else known.gap,
            minute_code=None if known is None else known.minute_code,
            speed=None if scale is None or self.speed is None else self.speed / scale,
            code=self.options.marks or (None if known is None else known.marks),
            kind=None if known is None else known.mark_kind,
            directed=directed,
        )

    @property
    def start_time(self) -> str:
        """Date and time from which the record counts its seconds."""
        return DEFAULT_START if self.description is None else self.description.start_time

    @property
    def count(self) -> int | None:
        """Number of traces; None where neither user nor description names them."""
        return len(self.traces) or None

    def pendulums(self, traces: Sequence[DescribedTrace]) -> tuple[Any, ...]:
        """The pendulums of some traces, with their periods and what else is described of them.

        Raises
        ------
        UsageError
            A period is said of a pendulum that no trace shows.
        """
        labels = list(dict.fromkeys(label for trace in traces for label in trace.combination))
        labels.sort(key=lambda label: (not label.isdigit(), int(label) if label.isdigit() else 0, label))
        described = {} if self.description is None else {each.label: each for each in self.description.pendulums}
        periods = dict(self.options.periods)
        if "" in periods:
            if len(labels) > 1:
                raise UsageError(
                    f"--period {periods['']:g}: there are pendulums {', '.join(labels)}; write LABEL=SECONDS"
                )
            periods[labels[0]] = periods.pop("")
        for label in periods:
            if label not in labels:
                raise UsageError(
                    f"--period {label}=...: there is no pendulum '{label}'; pendulums: {', '.join(labels)}"
                )
        found = []
        for label in labels:
            pendulum = described.get(label, DescribedPendulum(label=label))
            found.append(pendulum.model_copy(update={"period": periods[label]}) if label in periods else pendulum)
        return tuple(found)


def default_traces(count: int) -> tuple[DescribedTrace, ...]:
    """Traces of which nothing is known: each a pendulum of its own, numbered from the left."""
    return tuple(DescribedTrace(name=str(k), combination={str(k): 1.0}) for k in range(1, count + 1))


def _split(texts: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Names and combinations of NAME or NAME:COMBINATION."""
    names, combinations = [], {}
    for text in texts:
        name, colon, combination = text.partition(":")
        if not name or (colon and not combination):
            raise UsageError(f"--trace {text}: write it as NAME or NAME:COMBINATION, such as upper:1-2")
        if name in names:
            raise UsageError(f"--trace names '{name}' twice; give each trace once")
        names.append(name)
        if colon:
            combinations[name] = combination
    return names, combinations


def _named(
    name: str, row: Any, pendulums: Sequence[str], described: Mapping[str, DescribedTrace], recombined: bool
) -> DescribedTrace:
    """A trace the user names: described as far as it is, of the pendulums its name or the user says."""
    if name in described and not recombined:
        return described[name]
    weights = {label: float(weight) for label, weight in zip(pendulums, row, strict=True) if weight}
    known = described[name].model_dump() if name in described else {"name": name}
    return DescribedTrace.model_validate({**known, "combination": weights})
