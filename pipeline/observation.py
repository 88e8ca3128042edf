"""What a method is given: the two series of one difference pendulum, and what is known of the instrument."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from xarray import DataTree

from data_schemas.errors import RecordError, RefusedError, UsageError
from pipeline.arrays import Floats, evened, row_means_present
from pipeline.conditions import DAY, Constants, Tie, by_air, by_temperature, rate_uncertainty, refuse_impossible, tie

GRID_TOLERANCE = 1e-9  # s; times this close to a uniform grid are taken to lie on it
MOST_GRID_ROWS = 4  # a grid more than this many times longer than the series is no grid
ON_THE_WAY = ("temperature", "latitude", "longitude", "speed", "course")  # constants that /record may have in time


@dataclass(frozen=True)
class Observation:
    """One difference pendulum of one record, in SI units and radians."""

    first: str  # labels of the pendulums; the difference is `first - second`
    second: str
    start: float  # time of the first sample that is used, in the record's own time, s
    time: Floats  # (n,) seconds from that sample
    step: float  # s; missing samples are NaN
    theta: Floats  # (n,) elongation of the first pendulum, rad
    difference: Floats  # (n,) of the difference pendulum, rad
    sigma_theta: float | None  # stated 1-sigma reading noise, rad
    sigma_difference: float | None
    frequency_reference: Floats  # (2,) circular, at `reference_gravity`, infinitesimal arc, rad s-1
    damping_rate: Floats | None  # (2,) stated, s-1
    reference_gravity: float  # m s-2
    period_relative_uncertainty: Floats  # (2,) stated, 1 sigma (0 where nothing is stated)
    chronometer_rate: float  # seconds a day that the chronometer loses
    restoring: str | None  # "sine", "linear", or None where the record does not say
    vertical: Floats | None = None  # (n,) recorded vertical acceleration of the support, m s-2, up positive
    constants: Constants = field(default_factory=dict)
    """What else /instrument states, by name; of pendulums those of the pair. What changes within the record, as
    `temperature` may, is its mean here, and `temperature_course`."""
    course_time: Floats | None = None  # (m,) times of a course within the record, by its own clock, s
    tie: Tie | None = None  # periods from base stations
    period_change: Floats | None = None  # (2,) relative, from the stated periods, under the record's conditions

    @property
    def whole(self) -> bool:
        """Whether no sample is missing."""
        series = (self.theta, self.difference, self.vertical)
        return all(bool(np.isfinite(each).all()) for each in series if each is not None)

    @property
    def frequency_ratio(self) -> float:
        """n1/n2 under the record's conditions; it does not depend on gravity and is held when n2 is fitted."""
        frequency = self.frequency_reference
        if self.period_change is not None:
            frequency = frequency / (1.0 + self.period_change)
        if "yaw_rate" in self.constants:
            frequency = np.sqrt(frequency**2 - float(self.constants["yaw_rate"]) ** 2)
        return float(frequency[0] / frequency[1])

    def felt_gravity(self, frequency: float) -> float:
        """Gravity that makes the second pendulum swing so (rad s-1, in the record's own time) as it is, m s-2.

        Tilt, rate of turn and the ship's way are in it: it is what accelerations of the support compare with.
        """
        stretched = 1.0 if self.period_change is None else 1.0 + float(self.period_change[1])
        clock = 1.0 + self.chronometer_rate / DAY
        return self.reference_gravity * (frequency * stretched / (clock * float(self.frequency_reference[1]))) ** 2

    @property
    def damping_difference(self) -> float:
        """gamma1 - gamma2, s-1; zero where no damping is stated."""
        return 0.0 if self.damping_rate is None else float(self.damping_rate[0] - self.damping_rate[1])


def observe(record: DataTree, pair: str | None = None) -> Observation:
    """Form the difference pendulum of a record.

    Parameters
    ----------
    record : DataTree
        A valid record (see `data_schemas.check`).
    pair : str, optional
        "A-B" with pendulum labels; the first recorded difference, else the first two pendulums, by default.

    Raises
    ------
    UsageError
        `pair` names no two pendulums of the record.
    RecordError
        The traces cannot give the difference or its first pendulum, or period or gravity is missing.
    RefusedError
        The samples lie at uneven times.
    """
    traces, recorded = record["record"].dataset.variables, record.dataset.variables["time"].values
    labels = [str(label) for label in traces["pendulum"].values]
    combination = np.asarray(traces["combination"].values, dtype=np.float64)
    first, second = choose_pair(labels, combination, pair)
    one, two = (np.eye(len(labels))[labels.index(label)] for label in (first, second))
    elongation = np.asarray(traces["elongation"].values, dtype=np.float64)
    time = evened(np.asarray(recorded, dtype=np.float64))
    of_theta = weights_of(combination, one, first)
    of_difference = weights_of(combination, one - two, f"{first}-{second}")
    rows = [combine(of_theta, elongation), combine(of_difference, elongation)]
    if "vertical_acceleration" in traces:
        rows.append(np.asarray(traces["vertical_acceleration"].values, dtype=np.float64))
    # before its first reading and after its last the first pendulum could only be extrapolated
    within = span(rows[0])
    if within.stop == 0:
        raise RecordError(f"record/elongation: pendulum '{first}' has no reading at all; give its trace")
    start = float(time[within.start])
    time, step, series = uniform_grid(time[within] - start, [row[within] for row in rows])
    return Observation(
        start=start, first=first, second=second, time=time, step=step, theta=series[0], difference=series[1],
        vertical=series[2] if len(rows) == 3 else None, sigma_theta=_noise(traces, of_theta),
        sigma_difference=_noise(traces, of_difference), **instrument(record, (first, second)),
    )  # fmt: skip


def span(series: Floats) -> slice:
    """From the first value of a series that is there to behind the last; empty where there is none.

    Examples
    --------
    >>> span(np.array([np.nan, 1.0, np.nan, 2.0])), span(np.array([np.nan]))
    (slice(1, 4, None), slice(0, 0, None))
    """
    known = np.flatnonzero(np.isfinite(series))
    return slice(int(known[0]), int(known[-1]) + 1) if known.size else slice(0, 0)


def instrument(record: DataTree, pendulums: tuple[str, ...]) -> dict[str, Any]:
    """The instrument constants of the named pendulums, as the fields of `Observation`."""
    stored = record["instrument"].dataset if "instrument" in record.children else None
    if stored is None or "period" not in stored:
        raise RecordError(
            "instrument/period: missing; gravity needs the period of each pendulum at instrument/reference_gravity"
        )
    if "reference_gravity" not in stored:
        raise RecordError("instrument/reference_gravity: missing; give the gravity at which the periods hold, m s-2")
    known = [str(label) for label in stored["pendulum"].values]
    for label in pendulums:
        if label not in known:
            raise RecordError(f"instrument/pendulum: no constants for pendulum '{label}'; it knows {', '.join(known)}")
    constants = _constants(stored, [known.index(label) for label in pendulums])
    constants |= _constants(record["record"].dataset[[name for name in ON_THE_WAY if name in record["record"]]], [])
    constants |= epoch_of(record) | clock_of(record)
    period, gravity = np.asarray(constants["period"]), float(constants["reference_gravity"])
    time = np.asarray(record.dataset.variables["time"].values, dtype=np.float64)
    tied = tie(constants, 0.5 * float(time[0] + time[-1]), gravity)
    uncertainty = constants["period_uncertainty"] / period if "period_uncertainty" in constants else 0.0 * period
    longer = by_temperature(constants) + by_air(constants) + (0.0 if tied is None else tied.period - period)
    refuse_impossible(constants, period, longer)
    restoring = stored.attrs.get("restoring")
    return {
        "frequency_reference": 2.0 * np.pi / period,
        "damping_rate": constants.get("damping_rate"),
        "reference_gravity": gravity,
        "period_relative_uncertainty": uncertainty if tied is None else tied.relative_uncertainty,
        "chronometer_rate": float(constants.get("chronometer_rate", 0.0)),
        "restoring": None if restoring is None else str(restoring),
        "constants": constants,
        "course_time": time if any(name.endswith("_course") for name in constants) else None,
        "tie": tied,
        "period_change": longer / period if longer.any() else None,
    }


def epoch_of(record: DataTree) -> dict[str, float]:
    """Unix time of the record's time 0, s, where its units name a date."""
    _, found, date = str(record.dataset.variables["time"].attrs.get("units", "")).partition("since ")
    try:
        epoch = datetime.fromisoformat(date.strip()) if found else None
    except ValueError:
        return {}
    return {} if epoch is None else {"epoch": (epoch if epoch.tzinfo else epoch.replace(tzinfo=UTC)).timestamp()}


def clock_of(record: DataTree) -> dict[str, float]:
    """Uncertainty of the clock's rate by that of the times, relative, 1 sigma, where the record states it."""
    traces = record["record"].dataset.variables
    if "time_uncertainty" not in traces:
        return {}
    time, sigma = record.dataset.variables["time"].values, traces["time_uncertainty"].values
    return {"time_uncertainty": rate_uncertainty(time.astype(np.float64), sigma.astype(np.float64))}


def _constants(stored: Any, rows: list[int]) -> dict[str, Any]:
    """Numbers of /instrument by name, of the pendulums those of the given rows; courses in time as mean and course."""
    constants: dict[str, Any] = {}
    coordinates = set(stored.coords)
    for name, variable in stored.variables.items():
        if name in coordinates or variable.dtype.kind not in "fiu":
            continue
        values = np.asarray(variable.values, dtype=np.float64)
        if "time" in variable.dims:
            constants[f"{name}_course"] = values
            constants[str(name)] = float(values.mean())
        elif "pendulum" in variable.dims:
            constants[str(name)] = values.take(rows, axis=variable.dims.index("pendulum"))
        else:
            constants[str(name)] = values if values.ndim else float(values)
    return constants


def uniform_grid(time: Floats, series: Sequence[Floats]) -> tuple[Floats, float, Sequence[Floats]]:
    """Lay samples on a uniform grid where their times allow it; absent samples become NaN. Returns time, step, series.

    `time` (n,) increases strictly, s, from 0 on; each of the series is (n,). `RefusedError`: the times lie on no grid.
    """
    count, length = time.size, float(time[-1])
    if count > 1 and np.abs(time - np.linspace(0.0, length, count)).max() <= GRID_TOLERANCE:
        return time, length / (count - 1), series
    step = float(np.diff(time).min()) if count > 1 else 0.0
    if step > 0.0 and length / step <= MOST_GRID_ROWS * count:
        # the first spacing fixes the row numbers, the whole length the step
        last = int(np.rint(length / step))
        step = length / last
        rows = np.rint(time / step).astype(np.int64)
        if np.abs(time - rows * step).max() <= GRID_TOLERANCE:
            laid = np.full((len(series), last + 1), np.nan)
            laid[:, rows] = series
            return np.arange(last + 1) * step, step, list(laid)
    raise RefusedError("time: the samples lie at uneven times; use --method joint")


def choose_pair(labels: list[str], combination: Floats, pair: str | None) -> tuple[str, str]:
    """Labels of the two pendulums: those named, else of the first recorded difference, else the first two."""
    if pair is not None:
        for first, second in itertools.permutations(labels, 2):
            if pair == f"{first}-{second}":
                return first, second
        raise UsageError(f"pair '{pair}': give two of the record's pendulums as A-B; it has {', '.join(labels)}")
    for row in combination:
        used = np.flatnonzero(row)
        if used.size == 2 and np.isclose(row[used].sum(), 0.0):
            first, second = used[np.argsort(-row[used])]
            return labels[first], labels[second]
    if len(labels) < 2:
        raise RecordError("record/combination: one pendulum gives no difference; gravity at sea needs two in one frame")
    return labels[0], labels[1]


def weights_of(combination: Floats, wanted: Floats, name: str) -> Floats:
    """Of each trace in a wanted combination of pendulums, one if it is that; `RecordError`: they cannot give it."""
    recorded = np.flatnonzero((combination == wanted).all(axis=1))
    if recorded.size:
        return np.asarray(np.eye(len(combination))[recorded[0]])
    weights = np.linalg.lstsq(combination.T, wanted, rcond=None)[0]
    if np.abs(combination.T @ weights - wanted).max() > 1e-9:
        raise RecordError(
            f"record/combination: the traces cannot give '{name}'; record one pendulum and a difference, "
            "or two pendulums"
        )
    return np.asarray(np.where(np.abs(weights) > 1e-12, weights, 0.0))


def combine(weights: Floats, elongation: Floats) -> Floats:
    """Series of weighted traces; one that is not used may be missing."""
    used = np.flatnonzero(weights)
    return elongation[used[0]] if used.size == 1 and weights[used[0]] == 1.0 else weights[used] @ elongation[used]


def _noise(traces: Any, weights: Floats) -> float | None:
    """Stated noise of weighted traces, rad; of noise that changes its root mean square."""
    if "elongation_uncertainty" not in traces:
        return None
    sigma = np.asarray(traces["elongation_uncertainty"].values, dtype=np.float64)
    if sigma.ndim == 2:
        sigma = np.sqrt(row_means_present(np.square(sigma)))
    used = np.flatnonzero(weights)
    stated = float(np.linalg.norm(weights[used] * sigma[used]))
    return stated if 0.0 < stated < np.inf else None
