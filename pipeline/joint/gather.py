"""A record as the joint reduction takes it: every trace as it was read, what is stated of the instrument."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from xarray import DataTree

from data_schemas.errors import RecordError, RefusedError
from pipeline.arrays import Floats, evened
from pipeline.conditions import TEMPERATURE
from pipeline.joint import screening
from pipeline.joint.flow import NODES, POINTS
from pipeline.joint.lattice import FAST_ANGLE, Lattice, lay, shared_angle
from pipeline.joint.problem import Problem
from pipeline.ledger import earth
from pipeline.observation import instrument

LEAST_SWINGS = 20.0
DENSE = 5.0  # recorded heave with so many values a period of its fastest waves is interpolated, s-1
NOISY = 1e-7  # of gravity, 1 sigma by the noise of a recorded heave, above which it is a reading of the motion
ACCELEROMETER = 3e-5  # over reference gravity: noise of an acceleration that is a reading, where it does not show
MOSTLY = 0.9  # of the samples: so many tell how the case tilts
SHAPE, BESIDE = 20.0, (7.0, 8.0, 9.0, 10.0, 11.0)  # of a taper that lets 1e-7 pass; turns in the record
TAPER, SHOWN = 240.0, 1e-7  # s, of one that shows how a bias drifts; share of it that lies beside gaps
UNEVEN, APART = 1.5, 3.0  # of the usual step, one that is a gap; halves of a taper, from one that is whole to another
CHANCE, HARMLESS = 30.0, 3e-6  # times a mean's noise over such a taper, and of gravity: least change of a bias
COARSEST = 0.3  # of the swing's root mean square, a step to which readings are rounded
LEAST_TIDE = 3e-8  # of gravity, of its change over the record: weights differ from a mean's by a tenth
MOST_STEPS = 30  # of a film's paper
LASTING = 10.0  # s: errors of a film's times, where the noise of its marks is not stated
LONGEST_GAP, ENDS = 1.0, 1  # s, of a heave that is interpolated; samples that it may lack at either end
ABOVE = 2.0  # of the noise: what may stand beside zero frequency by chance
NEIGHBOURS, ENOUGH = 7, 20000  # values whose sixth difference shows their noise; so many such


@dataclass(frozen=True)
class Gathered:
    """Readings and constants."""

    problem: Problem
    pendulums: tuple[str, ...]  # Labels
    constants: dict[str, Any]  # What /instrument states; see `pipeline.observation.instrument`.
    noise: Floats
    """(t + 2,) stated of traces, rad, NaN = not stated; of accelerations that are readings, over reference gravity."""
    heave_noise: float
    """White noise of a recording that is interpolated, over reference gravity, times the root of its step, s1/2."""
    heave_doubt: float  # 1 sigma of its mean over reference gravity, which gravity shares
    still: tuple[str, ...]  # Traces that stand still for a while, and when, in words
    tilts: bool  # Whether elongations are measured from a case whose tilt is not recorded
    film: bool  # Whether the traces were read from a film, whose spots and optics err with the swing
    shown: tuple[float, float]  # The swing's period between a film's marks, s, and its 1 sigma; NaN where not told
    denser: "Callable[[], Gathered]"
    """The same with as many nodes as readings, for motion that the traces do not show before they are fitted."""


def gather(record: DataTree, *, calm: bool = True) -> Gathered:
    """Lay a record out; unless it is calm, with as many nodes as readings. RecordError where period or gravity is
    missing or no trace has a reading, RefusedError where the record is too short."""
    stored = record["record"].dataset
    labels = tuple(str(label) for label in stored["pendulum"].values)
    time = evened(np.asarray(record.dataset["time"].values, dtype=np.float64))
    series: Floats = np.asarray(stored["elongation"].values, dtype=np.float64)
    combination: Floats = np.asarray(stored["combination"].values, dtype=np.float64)
    known = instrument(record, labels)
    frequency: Floats = np.asarray(known["frequency_reference"])
    if known["period_change"] is not None:
        frequency = frequency / (1.0 + known["period_change"])
    frequency = frequency * (1.0 + known["chronometer_rate"] / 86400.0)  # in the record's own time
    traces = tuple(str(trace) for trace in stored["trace"].values)
    _of_single_traces(record, traces, known["constants"])
    if not np.isfinite(series).any():
        raise RecordError("record/elongation: no trace has a reading")
    swing, gravity = float(frequency.mean()), float(known["reference_gravity"])
    heave = None
    if "vertical_acceleration" in stored and known["restoring"] != "linear":  # which linear pendulums do not feel
        heave = np.asarray(stored["vertical_acceleration"].values, dtype=np.float64)
    screening.refuse_wrong_units(time, series, heave, swing, gravity)
    series, more, tilts = _from_the_vertical(record, time, series, combination)
    series, still = screening.moving(time, screening.without_copies(series), swing, traces)
    screening.refuse_exchanged_traces(time, series, combination, swing, traces)
    some = np.asarray(np.isfinite(series).any(axis=0))
    if not some.any():
        raise RefusedError(f"record/elongation: no trace swings: {'; '.join(still)}; check the traces and their times")
    used = slice(int(np.argmax(some)), some.size - int(np.argmax(some[::-1])))
    all_times, time, series = time, time[used], series[:, used]
    swings = float(time[-1] - time[0]) * swing / (2.0 * np.pi)
    if swings < LEAST_SWINGS:
        raise RefusedError(
            f"time: {swings:.1f} swings are too few to tell gravity from the ship's motion; give at least "
            f"{LEAST_SWINGS:.0f} swings ({LEAST_SWINGS * 2.0 * np.pi / swing:.0f} s)"
        )
    rows, dense, white, accelerations = [series], False, 0.0, np.full(2, ACCELEROMETER)
    if tilts:
        rows.append(np.asarray(stored["horizontal_acceleration"].values, dtype=np.float64)[None, used] / gravity)
    if heave is not None:
        heave = heave[used] / gravity
        there, (drift, bent) = np.flatnonzero(np.isfinite(heave)), _drift(time, heave)
        heave = heave - drift
        dense = bool(there.size > 8) and float(np.diff(time[there]).max()) < LONGEST_GAP
        dense = dense and float(np.median(np.diff(time[there]))) * DENSE < 2.5
        dense = dense and there[0] <= ENDS and there[-1] >= time.size - 1 - ENDS
        if dense:
            white = _white(time[there], heave[there])
        if white > NOISY * np.sqrt(time[-1] - time[0]):
            dense, accelerations[1], white = False, white / np.sqrt(np.median(np.diff(time[there]))), 0.0
        if not dense:
            rows += [*([] if tilts else [np.full((1, time.size), np.nan)]), heave[None]]
    arc = 1.5 * float(np.nanmax(np.nanstd(series[np.isfinite(series).any(axis=1)], axis=1)))
    sine = known["restoring"] != "linear"
    angle = min(shared_angle(time, each, swing, arc, sine=sine) for each in series) if calm else FAST_ANGLE
    lattice = lay(time, np.concatenate(rows), combination, swing, angle=angle)
    spline, doubt = None, 0.0 if heave is None else bent
    if heave is not None and dense:
        from scipy.interpolate import CubicSpline

        since, value = time[there] - lattice.start, heave[there]
        even = np.arange(since[0], since[-1], np.diff(since).min())
        _, slow = _bias(CubicSpline(since, value + drift[there])(even), white / np.sqrt(even[1] - even[0]))
        doubt = float(np.hypot(doubt, slow))
        spline = CubicSpline(since, value)
        spline = CubicSpline(since, value - _bias(spline(even), 0.0)[0])
    stated = np.full(series.shape[0], np.nan)
    if "elongation_uncertainty" in stored:
        given = np.asarray(stored["elongation_uncertainty"].values, dtype=np.float64)
        stated = given if given.ndim == 1 else np.sqrt(np.nanmean(given**2, axis=1))
    steps = np.array([screening.quantum(each) for each in series])
    if steps.max() > COARSEST * arc / 1.5:
        raise RefusedError(
            f"record/elongation: rounded to {steps.max():.2g} rad, too coarse for a swing of {arc / 1.5:.2g} rad: "
            "such an error follows the swing; give finer readings"
        )
    stated = np.where(steps > 0.0, np.hypot(np.nan_to_num(stated), steps / np.sqrt(12.0)), stated)
    stated = np.hypot(stated, more)
    damping = known["damping_rate"]
    return Gathered(
        Problem(
            lattice, frequency**2, np.zeros(len(labels)) if damping is None else np.asarray(damping),
            screening.far_off(lattice.trace, lattice.value, series.shape[0]), spline,
            _track(known, all_times, lattice), steps,
            *(_of_film(record, all_times, lattice) if "film" in record.children else ()),
        ),
        labels, known, np.append(stated, accelerations), white, doubt, still, tilts, "film" in record.children,
        _shown(record), partial(gather, record, calm=False),
    )  # fmt: skip


def _of_single_traces(record: DataTree, traces: tuple[str, ...], constants: dict[str, Any]) -> None:
    """Constants of single traces in the record's order; RecordError where the instrument does not name them all."""
    stored = record["instrument"].dataset
    labels = [str(label) for label in stored["trace"].values] if "trace" in stored else []
    for name, variable in stored.data_vars.items():
        if variable.dims == ("trace",):
            missing = [trace for trace in traces if trace not in labels]
            if missing:
                raise RecordError(f"instrument/trace: lacks '{missing[0]}'; instrument/{name} needs all traces")
            constants[str(name)] = np.asarray(variable.values)[[labels.index(trace) for trace in traces]]


def _from_the_vertical(
    record: DataTree, time: Floats, series: Floats, combination: Floats
) -> tuple[Floats, Floats, bool]:
    """Traces, (t, n), measured from the vertical where the tilt of the case is recorded; the noise that this adds to
    each, (t,); and whether the tilt is not known, so that the horizontal acceleration in the earth's frame must tell it
    (of an accelerometer on the case it would not). RefusedError where nothing does."""
    stored, stated, none = record["record"].dataset, record["instrument"].attrs, np.zeros(series.shape[0])
    if stored.attrs.get("reference") == "vertical":
        return series, none, False
    tilt, sway = (
        np.asarray(stored[name].values, dtype=np.float64) if name in stored else np.full(time.size, np.nan)
        for name in ("case_tilt", "horizontal_acceleration")
    )
    known = np.isfinite(tilt)
    if known.mean() > MOSTLY:
        level = combination.sum(axis=1)
        noise = _white(time[known], tilt[known]) / np.sqrt(np.median(np.diff(time[known])))
        return series + np.where(level[:, None], level[:, None] * tilt, 0.0), np.abs(level) * noise, False
    if stored.attrs.get("reference") != "case" or stated.get("restoring") == "linear":
        return series, none, False
    if np.isfinite(sway).mean() > MOSTLY and stated.get("acceleration_frame") != "case":
        return series, none, True
    raise RefusedError(
        "record attribute reference: 'case', and nothing tells how the case tilts; give record/case_tilt, or "
        "record/horizontal_acceleration in the earth's frame, or elongations from the vertical"
    )


def _track(known: dict[str, Any], time: Floats, lattice: Lattice) -> Floats:
    """Known change of gravity over reference gravity, from its mean, at the nodes of each step: way, temperature."""
    constants, change = known["constants"], np.zeros(time.size)
    if any(f"{name}_course" in constants for name in earth.WAY) and all(name in constants for name in earth.WAY):
        change -= earth.eotvos(*earth.navigation(constants)) / known["reference_gravity"]
    if "temperature_course" in constants and all(name in constants for name in TEMPERATURE):
        longer = float(np.mean(constants["temperature_coefficient"] / constants["period"]))
        change += (1.0 + longer * (constants["temperature_course"] - constants["temperature"])) ** -2.0
    if "epoch" in constants and all(name in constants for name in earth.PLACE):
        lost = earth.tidal_loss(constants, time) / known["reference_gravity"]
        change -= lost if np.ptp(lost) > LEAST_TIDE else 0.0
    if not np.ptp(change):
        return np.zeros((0, POINTS))
    nodes = lattice.start + lattice.step * np.arange(lattice.nodes)
    mean = np.interp(nodes, time, change).mean()
    return np.asarray(np.interp(nodes[:, None] + lattice.step * NODES, time, change) - mean)


def _shown(record: DataTree) -> tuple[float, float]:
    """The period of the swing, s, that a film shows between its marks, and its 1 sigma; NaN where it tells none."""
    stated = record["film"].attrs if "film" in record.children else {}
    try:
        period, sigma = (float(stated.get(f"swing_period{end}", np.nan)) for end in ("", "_uncertainty"))
    except (TypeError, ValueError):
        return np.nan, np.nan
    return period, sigma


def _of_film(record: DataTree, time: Floats, lattice: Lattice) -> tuple[float, float, tuple[float, ...], Floats]:
    """1 sigma of a film's times, s; the marks' own noise, s3/2; times of steps of the paper, s since the first node;
    the mean speed over that at each reading, which is slower where delays are longer; empty where it is not stated."""
    stated, film = record["record"].dataset.get("time_uncertainty"), record["film"].attrs
    known = np.array([]) if stated is None else np.asarray(stated.values)[np.isfinite(stated.values)]
    sigma = float(np.median(known)) if known.size else 0.0
    try:
        noise = float(film.get("time_noise", sigma * np.sqrt(LASTING)))
        steps = np.ravel(np.asarray(film.get("paper_steps", ()), dtype=np.float64)) - lattice.start
    except (TypeError, ValueError):
        noise, steps = np.nan, np.zeros(0)
    if not 0.0 <= noise < np.inf or steps.size > MOST_STEPS:
        raise RecordError("film: attributes time_noise and paper_steps are not those of a film; digitise it again")
    pace = np.zeros(0)
    if "paper_speed" in record["film"].dataset:
        speed: Floats = np.asarray(record["film"].dataset["paper_speed"].values, dtype=np.float64)
        known = np.isfinite(speed)
        pace = np.mean(speed[known]) / np.interp(lattice.start + lattice.time, time[known], speed[known])
    return sigma, noise, tuple(steps[(steps > 0.0) & (steps < lattice.duration)].tolist()), pace


def _bias(heave: Floats, noise: float) -> tuple[float, float]:
    """Bias of a recorded heave at even times over reference gravity, and its 1 sigma, as the ship neither sinks nor
    flies: a mean under a taper that lets no sea pass; sigma from what stands below the sea, above noise."""
    weight, since = np.kaiser(heave.size, SHAPE), np.linspace(0.0, 1.0, heave.size)
    weight /= weight.sum()
    beside = [np.abs(np.sum(weight * np.exp(2j * np.pi * turns * since) * heave)) for turns in BESIDE]
    square = float(np.mean(np.square(beside))) - ABOVE * noise**2 * float(weight @ weight)
    return float(weight @ heave), float(np.sqrt(max(square, 0.0)))


def _drift(time: Floats, heave: Floats) -> tuple[Floats, float]:
    """How the bias of a recorded heave over reference gravity, (n,), NaN where missing, changes, and 1 sigma of its
    mean: what it has below the sea, by parabolas under tapers that let no sea pass, but for the mean; on along a line
    at the ends, where no taper fits. 0 where gaps leave no taper, and of what harms nothing or may be noise."""
    from scipy.interpolate import CubicHermiteSpline

    known, none = np.isfinite(heave), (np.zeros(time.size), 0.0)
    at, value = time[known], heave[known]
    if at.size < NEIGHBOURS or at[-1] - at[0] < TAPER:  # a shorter taper lets the sea pass
        return none
    spacing, half, lines, steps = np.gradient(at), 0.5 * TAPER, [], np.diff(at)
    wide = steps > UNEVEN * np.median(steps)
    beside = np.append(wide, False) | np.append(False, wide)
    for middle in np.linspace(at[0] + half, at[-1] - half, 1 + int(4.0 * (at[-1] - at[0] - TAPER) / TAPER)):
        inside = np.abs(at - middle) <= half
        x = (at[inside] - middle) / half
        weight = np.i0(SHAPE * np.sqrt(1.0 - x**2)) * spacing[inside]
        if weight[beside[inside]].sum() < SHOWN * weight.sum():
            terms = np.stack([np.ones(x.size), x, x**2])
            lines.append((middle, *np.linalg.solve(terms * weight @ terms.T, terms * weight @ value[inside])))
    middles, level, slope, bend = np.array(lines).reshape(-1, 4).T
    if np.diff(middles, prepend=at[0] - half, append=at[-1] + half).max() > APART * half:
        return none
    inside = np.clip(time, middles[0], middles[-1])
    if middles.size > 1:
        level = CubicHermiteSpline(middles, level, slope / half)(inside)
    beyond = (time - inside) / half
    drift = level + beyond * np.interp(inside, middles, slope)
    if np.ptp(drift) < max(CHANCE * _white(at, value) / np.sqrt(half), HARMLESS):
        return none
    doubt = float(np.abs(np.mean((beyond**2 * np.interp(inside, middles, bend))[known])))
    return drift - drift[known].mean(), doubt


def _white(time: Floats, heave: Floats) -> float:
    """White noise of a recorded heave times the root of its step, from divided differences: slow waves leave none."""
    some = slice(None, None, 1 + time.size // ENOUGH)
    at, value = (np.lib.stride_tricks.sliding_window_view(each, NEIGHBOURS)[some] for each in (time, heave))
    apart = (at[:, :, None] - at[:, None, :]) / (at[:, -1:, None] - at[:, :1, None]) + np.eye(NEIGHBOURS)
    weights = 1.0 / apart.prod(axis=2)
    rest = np.sum(weights * value, axis=1) / np.linalg.norm(weights, axis=1)
    spacing = np.diff(time)  # what is interpolated over a long one has the noise of few values
    return float(np.median(np.abs(rest)) / 0.6745 * np.sqrt(np.sum(spacing**2) / np.sum(spacing)))
