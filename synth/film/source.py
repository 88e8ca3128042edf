"""What is exposed: the elongations of a record, or of a scene without its recording's noise and defects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.contents import Contents, from_tree
from data_schemas.errors import RecordError
from data_schemas.scene import Scene
from data_schemas.scene_recording import Recording
from synth.phase import Floats

if TYPE_CHECKING:
    import xarray as xr

RATE = 100
"""Readings a second of a scene: a spline of degree 5 then errs by 1e-9 of a swing of 1 s."""

FEWEST = 8
"""Samples a period that a record must have: the spline errs by 1e-5 of the swing at 8, by 1e-4 at 5."""

BETWEEN = 60.0
"""Seconds between two readings of the thermometers."""

BLOCK = 8192
_KEPT = 1 << 20  # values of a scene that are kept rather than simulated twice

Blocks = Iterator[tuple[Floats, Floats]]


@dataclass(frozen=True)
class Source:
    """Elongations to expose, and what an observer knows of them.

    Attributes
    ----------
    record_id, title, start_time : str
    traces, pendulums : tuple of str
        Labels.
    combination : (traces, pendulums) array
    instrument : dict
        Name of a variable of /instrument to its numbers, as far as known.
    restoring : str
    readings : list of dict
        Conditions that change with time, as an observer would read them: once a minute and at the end.
    begin, end, step : float
        Time of the first and last sample and the usual time between two, s.
    longest : float
        Samples further apart than this belong to a gap, s.
    blocks : callable
        Gives (seconds, elongation) block by block, (samples,) s and (traces, samples) rad, always the same.
    scene : Scene or None
    """

    record_id: str
    title: str
    start_time: str
    traces: tuple[str, ...]
    pendulums: tuple[str, ...]
    combination: Floats
    instrument: dict[str, Any]
    restoring: str
    readings: list[dict[str, float]]
    begin: float
    end: float
    step: float
    longest: float
    blocks: Callable[[], Blocks]
    scene: Scene | None = None


def source_of(given: xr.DataTree | Scene) -> Source:
    """Make a source of a record or a scene.

    Raises
    ------
    RecordError
        The record breaks its layout, or is sampled too coarsely to draw its curve.
    SceneError
        As `synth.simulate`.
    """
    return _of_scene(given) if isinstance(given, Scene) else _of_record(from_tree(given))


def _of_scene(scene: Scene) -> Source:
    from synth.conditions import stated
    from synth.recording.clock import set_clock
    from synth.streaming import stream

    bare = Recording(
        traces=scene.traces, sampling_rate=Fraction(RATE), chronometer_rate=scene.recording.chronometer_rate,
        write_damping=scene.recording.write_damping, write_restoring=scene.recording.write_restoring,
    )  # fmt: skip
    perfect = Scene.model_validate(dict(scene) | {"recording": bare})
    clock = set_clock(perfect)
    small = clock.count * len(scene.traces) <= _KEPT
    kept: list[Contents] = []

    def portions() -> Iterable[Contents]:
        return (record for record, _ in stream(perfect, clock))

    if small:
        kept = list(portions())
    first = kept[0] if small else next(iter(portions()))

    def blocks() -> Blocks:
        for portion in kept or portions():
            yield portion[""].variables["time"].values, portion["record"].variables["elongation"].values

    last = (clock.count - 1) / RATE
    read = np.unique(np.append(np.arange(0.0, last, BETWEEN), last))
    changing = {
        name: value for name, (dims, value) in stated(perfect, read * float(clock.scale)).items() if "time" in dims
    }
    readings = _readings(read, changing)
    return Source(
        **_known(first), readings=readings, begin=0.0, end=last, step=1 / RATE, longest=1.0, blocks=blocks, scene=scene
    )


def _of_record(record: Contents) -> Source:
    from data_schemas.checking import faults

    found = faults(record, "record")
    if found:
        raise RecordError(f"{found[0]}; mend the record before it is exposed")
    time: Floats = record[""].variables["time"].values
    elongation: Floats = record["record"].variables["elongation"].values
    known = _known(record)
    step = float(np.median(np.diff(time)))
    shortest = _shortest_period(known["instrument"], time, elongation)
    if step > shortest / FEWEST:
        raise RecordError(
            f"time: samples {step:g} s apart are too few to draw a swing of {shortest:.4g} s ({FEWEST} to the period"
            f" are needed); simulate with sampling_rate = {np.ceil(FEWEST / shortest):g} or more, or"
            " expose the scene itself"
        )

    def blocks() -> Blocks:
        for at in range(0, time.size, BLOCK):
            yield time[at : at + BLOCK], elongation[:, at : at + BLOCK]

    at = np.unique(np.append(np.searchsorted(time, np.arange(time[0], time[-1], BETWEEN)), time.size - 1))
    instrument = record.get("instrument")
    changing = (
        {}
        if instrument is None
        else {name: one.values[at] for name, one in instrument.variables.items() if one.dims == ("time",)}
    )
    return Source(
        **known, readings=_readings(time[at], changing), begin=float(time[0]), end=float(time[-1]), step=step,
        longest=shortest / FEWEST, blocks=blocks,
    )  # fmt: skip


def _readings(time: Floats, changing: dict[str, Any]) -> list[dict[str, float]]:
    """What changes, a dictionary a reading; none where nothing does."""
    if not changing:
        return []
    return [
        {"time": float(when), **{name: float(each[k]) for name, each in changing.items()}}
        for k, when in enumerate(time)
    ]


def _known(record: Contents) -> dict[str, Any]:
    attrs, variables = record[""].attrs, record["record"].variables
    instrument = record.get("instrument")
    units = str(record[""].variables["time"].attrs.get("units", ""))
    return {
        "record_id": str(attrs["record_id"]),
        "title": str(attrs.get("title", "")),
        "start_time": units.partition(" since ")[2] or "2000-01-01T00:00:00Z",
        "traces": tuple(str(each) for each in variables["trace"].values),
        "pendulums": tuple(str(each) for each in variables["pendulum"].values),
        "combination": variables["combination"].values,
        "instrument": {} if instrument is None else {name: one.values for name, one in instrument.variables.items()},
        "restoring": str(instrument.attrs.get("restoring", "sine")) if instrument is not None else "sine",
    }


def _shortest_period(instrument: dict[str, Any], time: Floats, elongation: Floats) -> float:
    """Of the pendulums as stated, or the usual time between every other passage through the mean, s."""
    if "period" in instrument:
        return float(np.min(instrument["period"]))
    shortest = np.inf
    for row in elongation:
        good = np.isfinite(row)
        swing, when = row[good] - np.mean(row[good]), time[good]
        at = np.flatnonzero(np.signbit(swing[1:]) != np.signbit(swing[:-1]))
        passages = when[at] - swing[at] * (when[at + 1] - when[at]) / (swing[at + 1] - swing[at])
        if passages.size > 2:
            shortest = min(shortest, float(np.median(passages[2:] - passages[:-2])))
    return shortest
