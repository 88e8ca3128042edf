"""What is exposed: the elongations of a record, or of a scene without its recording's noise and defects."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.contents import Contents, Group, from_tree
from data_schemas.errors import RecordError
from data_schemas.scene import Scene
from data_schemas.scene_recording import Recording
from synth.phase import Floats

if TYPE_CHECKING:
    import xarray as xr

RATE = 100  # Samples a second of a scene: a spline of degree 5 then errs by 1e-9 of a swing of 1 s
FEWEST = 8  # Samples a period that a record must have: the spline errs by 1e-5 of the swing at 8, by 1e-4 at 5
_BETWEEN = 60.0  # s between two readings of the thermometers
BLOCK = 1 << 16  # samples of one set of splines
_BESIDE = 64  # samples beyond a block that its splines see: what lies further away counts 0.43^64 = 1e-23
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
    scene: Scene | None = None

    @property
    def begin(self) -> float:
        """Time of the first sample, s."""
        return float(self.time[0])

    @property
    def end(self) -> float:
        """Time of the last sample, s."""
        return float(self.time[-1])

    @property
    def step(self) -> float:
        """Usual time between two samples, s."""
        return float(np.median(np.diff(self.time)))


def source_of(given: xr.DataTree | Scene) -> Source:
    """Make a source of a record or a scene.

    `RecordError`: the record breaks its layout, or is sampled too coarsely to draw its curve. `SceneError` as
    `synth.simulate`.
    """
    if not isinstance(given, Scene):
        return _of_record(from_tree(given))
    from synth.recording.clock import set_clock
    from synth.recording.observe import stated
    from synth.streaming import stream

    bare = Recording(
        traces=given.traces, sampling_rate=Fraction(RATE), chronometer_rate=given.recording.chronometer_rate,
        write_damping=given.recording.write_damping, write_restoring=given.recording.write_restoring,
    )  # fmt: skip
    perfect = Scene.model_validate(dict(given) | {"recording": bare})
    clock = set_clock(perfect)
    known: dict[str, Any] = {}
    pieces = []
    for record, _ in stream(perfect, clock):
        known = known or _known(record)
        pieces.append(record["record"].variables["elongation"].values)
    time = clock.seconds
    read = np.unique(np.append(np.arange(0.0, time[-1], _BETWEEN), time[-1]))
    conditions = stated(perfect, read * float(clock.scale)).items()
    changing = {name: value for name, (dims, value) in conditions if "time" in dims}
    return Source(
        **known, readings=_readings(read, changing), longest=1.0, time=time,
        elongation=np.concatenate(pieces, axis=1), scene=given,
    )  # fmt: skip


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
    at = np.unique(np.append(np.searchsorted(time, np.arange(time[0], time[-1], _BETWEEN)), time.size - 1))
    stated = record["instrument"].variables if "instrument" in record else {}
    changing = {name: one.values[at] for name, one in stated.items() if one.dims == ("time",)}
    readings = _readings(time[at], changing)
    return Source(**known, readings=readings, longest=shortest / FEWEST, time=time, elongation=elongation)


def _readings(time: Floats, changing: dict[str, Any]) -> list[dict[str, float]]:
    """What changes, a dictionary a reading; none where nothing does."""
    rows = ({name: float(each[k]) for name, each in changing.items()} for k in range(time.size))
    return [{"time": when, **row} for when, row in zip(time.tolist(), rows, strict=True)] if changing else []


def _known(record: Contents) -> dict[str, Any]:
    attrs, variables = record[""].attrs, record["record"].variables
    instrument = record.get("instrument", Group({}, {}))
    units = str(record[""].variables["time"].attrs.get("units", ""))
    return {
        "record_id": str(attrs["record_id"]),
        "title": str(attrs.get("title", "")),
        "start_time": units.partition(" since ")[2] or "2000-01-01T00:00:00Z",
        "traces": tuple(str(each) for each in variables["trace"].values),
        "pendulums": tuple(str(each) for each in variables["pendulum"].values),
        "combination": variables["combination"].values,
        "instrument": {name: one.values for name, one in instrument.variables.items()},
        "restoring": str(instrument.attrs.get("restoring", "sine")),
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


class Curves:
    """The elongation of every trace at any time: splines of degree 5 through unbroken runs of samples, continued beyond
    their ends by so many seconds; straight lines between runs.
    """

    def __init__(self, source: Source, beyond: float) -> None:
        self._source, self._beyond = source, beyond
        self._starts = source.time[BLOCK::BLOCK]  # of all blocks but the first
        self._block = functools.lru_cache(maxsize=2)(self._splines)

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Elongation and its rate, (traces, times) rad and rad/s, at increasing times."""
        owner = np.searchsorted(self._starts, times, side="right")
        parts = [[curve(times[owner == block]) for curve in self._block(block)] for block in np.unique(owner).tolist()]
        value, rate = np.concatenate([np.array(part) for part in parts], axis=2).swapaxes(0, 1)
        return value, rate

    def _splines(self, block: int) -> list[Callable[[Floats], tuple[Floats, Floats]]]:
        """Curve of each trace over a block of samples."""
        here = slice(max(block * BLOCK - _BESIDE, 0), (block + 1) * BLOCK + _BESIDE)
        time = self._source.time[here]
        return [self._curve(time, row[here]) for row in self._source.elongation]

    def _curve(self, time: Floats, values: Floats) -> Callable[[Floats], tuple[Floats, Floats]]:
        from scipy.interpolate import make_interp_spline

        good = np.flatnonzero(np.isfinite(values))
        broken = (np.diff(good) > 1) | (np.diff(time[good]) > self._source.longest)
        runs = [run for run in np.split(good, np.flatnonzero(broken) + 1) if run.size > 1]
        splines = [make_interp_spline(time[run], values[run], k=min(_DEGREE, run.size - 1)) for run in runs]

        def at(times: Floats) -> tuple[Floats, Floats]:
            value, rate = np.zeros((2, times.size))
            if good.size:
                value = np.interp(times, time[good], values[good])
            for run, spline in zip(runs, splines, strict=True):
                ends = time[run[0]] - self._beyond, time[run[-1]] + self._beyond
                here = slice(*np.searchsorted(times, ends))
                value[here], rate[here] = spline(times[here]), spline(times[here], 1)
            return value, rate

        return at
