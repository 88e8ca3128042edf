"""What is exposed: the elongations of a record, or of a scene without its recording's noise and defects."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr

from data_schemas.checking import faults
from data_schemas.contents import Contents, Group, from_tree
from data_schemas.errors import RecordError
from data_schemas.scene import Scene
from data_schemas.scene_recording import Recording
from synth.phase import Floats

RATE = 100  # Samples a second of a scene: a spline of degree 5 then errs by 1e-9 of a swing of 1 s
FEWEST = 8  # Samples a period that a record must have: the spline errs by 1e-5 of the swing at 8, by 1e-4 at 5
_BETWEEN = 60.0  # s between two readings of the thermometers
_DEGREE = 5


@dataclass(frozen=True)
class Source:
    """Elongations to expose, and what an observer knows of them."""

    record_id: str
    title: str
    start_time: str
    traces: tuple[str, ...]
    pendulums: tuple[str, ...]  # Labels
    combination: Floats  # (traces, pendulums)
    instrument: dict[str, Any]  # Name of a variable of /instrument to its numbers, as far as known
    restoring: str
    readings: list[dict[str, float]]
    """Conditions that change with time, as an observer would read them: once a minute and at the end."""
    longest: float  # Samples further apart than this belong to a gap, s
    time: Floats  # (samples,) s
    elongation: Floats  # (traces, samples) rad
    begin: float
    end: float  # Time of the first and of the last sample,
    step: float  # and usual time between two, s
    scene: Scene | None


def source_of(given: xr.DataTree | Scene) -> Source:
    """Make a source of a record or a scene; `SceneError` as `synth.simulate`.

    `RecordError`: the record breaks its layout, or is sampled too coarsely to draw its curve.
    """
    scene = given if isinstance(given, Scene) else None
    record = from_tree(given) if not isinstance(given, Scene) else _perfect(given)
    found = faults(record, "record") if scene is None else []
    if found:
        raise RecordError(f"{found[0]}; mend the record before it is exposed")
    attrs, variables = record[""].attrs, record["record"].variables
    instrument = record.get("instrument", Group({}, {}))
    known = {name: one.values for name, one in instrument.variables.items()}
    clock = record[""].variables["time"]
    time: Floats = clock.values
    elongation: Floats = variables["elongation"].values
    shortest, step = _shortest_period(known, time, elongation), float(np.median(np.diff(time)))
    if scene is None and step > shortest / FEWEST:
        raise RecordError(
            f"time: samples {step:g} s apart are too few to draw a swing of {shortest:.4g} s ({FEWEST} to the period"
            f" are needed); simulate with sampling_rate = {np.ceil(FEWEST / shortest):g} or more, or"
            " expose the scene itself"
        )
    at = np.unique(np.append(np.searchsorted(time, np.arange(time[0], time[-1], _BETWEEN)), time.size - 1))
    changing = {name: one.values[at] for name, one in instrument.variables.items() if one.dims == ("time",)}
    rows = [dict(zip(("time", *changing), row, strict=True)) for row in zip(time[at], *changing.values(), strict=True)]
    return Source(
        record_id=str(attrs["record_id"]),
        title=str(attrs.get("title", "")),
        start_time=str(clock.attrs.get("units", "")).partition(" since ")[2] or "2000-01-01T00:00:00Z",
        traces=tuple(str(each) for each in variables["trace"].values),
        pendulums=tuple(str(each) for each in variables["pendulum"].values),
        combination=variables["combination"].values,
        instrument=known,
        restoring=str(instrument.attrs.get("restoring", "sine")),
        readings=[{name: float(value) for name, value in row.items()} for row in rows] if changing else [],
        longest=shortest / FEWEST if scene is None else 1.0,
        time=time,
        elongation=elongation,
        begin=float(time[0]),
        end=float(time[-1]),
        step=step,
        scene=scene,
    )


def _perfect(scene: Scene) -> Contents:
    """The record of a scene without noise and defects of its recording."""
    from synth.recording.clock import set_clock
    from synth.streaming import joined, stream

    bare = Recording(
        traces=scene.traces, sampling_rate=Fraction(RATE), chronometer_rate=scene.recording.chronometer_rate,
        write_damping=scene.recording.write_damping, write_restoring=scene.recording.write_restoring,
    )  # fmt: skip
    perfect = Scene.model_validate(dict(scene) | {"recording": bare})
    return joined([record for record, _ in stream(perfect, set_clock(perfect))])


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


class Curves:
    """Elongations: splines of degree 5 through unbroken runs of samples, continued a little; between, straight."""

    def __init__(self, source: Source, beyond: float) -> None:
        from scipy.interpolate import make_interp_spline

        self._traces = []
        for row in source.elongation:
            good = np.isfinite(row)
            time, values, place = source.time[good], row[good], np.flatnonzero(good)
            broken = (np.diff(place) > 1) | (np.diff(time) > source.longest)
            runs = [run for run in np.split(np.arange(time.size), np.flatnonzero(broken) + 1) if run.size > 1]
            splines = [make_interp_spline(time[run], values[run], k=min(_DEGREE, run.size - 1)) for run in runs]
            ends = np.array([(time[run[0]] - beyond, time[run[-1]] + beyond) for run in runs]).reshape(-1, 2)
            self._traces.append((time, values, splines, ends))

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Elongation and its rate, (traces, times) rad and rad/s, at increasing times."""
        value, rate = np.zeros((2, len(self._traces), times.size))
        for k, (time, values, splines, ends) in enumerate(self._traces):
            if time.size:
                value[k] = np.interp(times, time, values)
            met = slice(np.searchsorted(ends[:, 1], times[0]), np.searchsorted(ends[:, 0], times[-1], side="right"))
            for spline, span in zip(splines[met], ends[met], strict=True):
                here = slice(*np.searchsorted(times, span))
                value[k, here], rate[k, here] = spline(times[here]), spline(times[here], 1)
        return value, rate
