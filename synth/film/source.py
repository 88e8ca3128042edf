"""What is exposed: the elongations of a record, or of a scene without its recording's noise and defects.

Between the samples lies a spline of degree 5, made piece by piece in bounded memory.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

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
_BESIDE = 64  # samples beyond a block that its spline sees: what lies further away counts 0.43^64 = 1e-23
_DEGREE = 5


@dataclass(frozen=True)
class Source:
    """Elongations to expose, and what an observer knows of them."""

    record_id: str
    title: str
    start_time: str
    traces: tuple[str, ...]
    pendulums: tuple[str, ...]
    """Labels."""
    combination: Floats
    """(traces, pendulums)."""
    instrument: dict[str, Any]
    """Name of a variable of /instrument to its numbers, as far as known."""
    restoring: str
    readings: list[dict[str, float]]
    """Conditions that change with time, as an observer would read them: once a minute and at the end."""
    begin: float
    end: float
    step: float
    """Time of the first and last sample and the usual time between two, s."""
    longest: float
    """Samples further apart than this belong to a gap, s."""
    blocks: Callable[[], Blocks]
    """Gives (seconds, elongation) block by block, (samples,) s and (traces, samples) rad, always the same."""
    scene: Scene | None = None


def source_of(given: xr.DataTree | Scene) -> Source:
    """Make a source of a record or a scene.

    `RecordError`: the record breaks its layout, or is sampled too coarsely to draw its curve. `SceneError` as
    `synth.simulate`.
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
    stated = {} if instrument is None else instrument.variables
    changing = {name: one.values[at] for name, one in stated.items() if one.dims == ("time",)}
    return Source(
        **known, readings=_readings(time[at], changing), begin=float(time[0]), end=float(time[-1]), step=step,
        longest=shortest / FEWEST, blocks=blocks,
    )  # fmt: skip


def _readings(time: Floats, changing: dict[str, Any]) -> list[dict[str, float]]:
    """What changes, a dictionary a reading; none where nothing does."""
    rows = ({name: float(each[k]) for name, each in changing.items()} for k in range(time.size))
    return [{"time": when, **row} for when, row in zip(time.tolist(), rows, strict=True)] if changing else []


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


class _Curve:
    """One trace over one block: a spline through every unbroken run of samples, straight lines between runs."""

    def __init__(self, time: Floats, values: Floats, longest: float, beyond: float) -> None:
        from scipy.interpolate import make_interp_spline

        good = np.isfinite(values)
        self._time, self._values, self._beyond = time[good], values[good], beyond
        self._splines: list[tuple[float, float, Any]] = []
        for run in runs(time, values, longest):
            if run.size > 1:
                spline = make_interp_spline(time[run], values[run], k=min(_DEGREE, run.size - 1))
                self._splines.append((float(time[run[0]]), float(time[run[-1]]), spline))

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Value and rate."""
        if not self._time.size:
            return np.zeros(times.size), np.zeros(times.size)
        value, rate = np.interp(times, self._time, self._values), np.zeros(times.size)
        for begin, end, spline in self._splines:
            here = slice(*np.searchsorted(times, [begin - self._beyond, end + self._beyond]))
            value[here], rate[here] = spline(times[here]), spline(times[here], 1)
        return value, rate


class Course:
    """The elongation of every trace at any time, asked for in order of time.

    Parameters
    ----------
    source
    node : float
        How far beyond a run of samples its curve is wanted, s.
    """

    def __init__(self, source: Source, node: float) -> None:
        self._longest, self._node = source.longest, node
        self._coming = self._pieces(source.blocks())
        self._held: deque[tuple[float, float, list[_Curve]]] = deque()  # begin, end, one curve a trace

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Elongation and its rate, (traces, times) rad and rad/s, at increasing times; none may lie before the last
        call's first.
        """
        held = self._held
        while held and held[0][1] <= times[0]:
            held.popleft()
        while not held or held[-1][1] <= times[-1]:
            piece = next(self._coming, None)
            if piece is None:
                break
            if piece[1] > times[0]:
                held.append(piece)
        found = []
        for begin, end, curves in held:
            here = times[(times >= begin) & (times < end)]
            found.append(np.array([curve.at(here) for curve in curves]))
        value, rate = np.concatenate(found, axis=2).swapaxes(0, 1)
        return value, rate

    def _pieces(self, blocks: Blocks) -> Any:
        before: tuple[Floats, Floats] | None = None
        here = next(blocks)
        begin = -np.inf
        while True:
            after = next(blocks, None)
            near = [] if before is None else [(before[0][-_BESIDE:], before[1][:, -_BESIDE:])]
            near += [here] if after is None else [here, (after[0][:_BESIDE], after[1][:, :_BESIDE])]
            time = np.concatenate([each[0] for each in near])
            values = np.concatenate([each[1] for each in near], axis=1)
            end = np.inf if after is None else float(after[0][0])
            yield begin, end, [_Curve(time, row, self._longest, self._node) for row in values]
            if after is None:
                return
            before, here, begin = here, after, end


def runs(time: Floats, values: Floats, longest: float) -> list[NDArray[np.intp]]:
    """Indices of samples that follow each other without a NaN or a long pause between them."""
    good = np.flatnonzero(np.isfinite(values))
    broken = (np.diff(good) > 1) | (np.diff(time[good]) > longest)
    return [run for run in np.split(good, np.flatnonzero(broken) + 1) if run.size]
