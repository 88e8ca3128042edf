"""A record as it was read, and its result: amplitudes, gravity by method and along the record, residual, spectrum."""

from typing import TYPE_CHECKING

import numpy as np
from xarray import Dataset, DataTree

from pipeline.arrays import Floats
from pipeline.methods import BEST_FIRST
from pipeline.period.cycles import arc_factor
from pipeline.plots import canvas
from pipeline.plots.canvas import angle_scale, draw_band, legend, note, over_time, panel, robust_limits, sheet, values

if TYPE_CHECKING:  # it names methods without matplotlib too
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ZOOM = 20.0  # s
_MOST_TRACES = 8
_MOST_POINTS = 4000  # of a smooth line
_MILLIGAL = 1e-5  # m s-2
_MARKS = ("in phase", "quadrature", "antiphase", "quadrature")  # of each quarter of a turn
_LEAST_REACH = 0.3  # turns either side: so that a named angle is always in sight


def record_figure(record: DataTree) -> "Figure":
    """Draw each trace of a valid record in a row: the whole at the left, twenty seconds at the right."""
    time, traces = _seconds(record), values(record, "record", "elongation")
    missing, step = 100.0 * float(np.isnan(traces).mean()), float(np.median(np.diff(time)))
    words = f"{canvas.record_of(record)} · {time.size} samples, {step:.4g} s apart · {missing:.2g} % missing"
    labels = _labels(record, "record", "trace")[:_MOST_TRACES]
    figure = sheet("Elongations of the record", words, 11.0, 0.9 + 2.3 * len(labels))
    grid = figure.add_gridspec(len(labels), 2, width_ratios=(2.4, 1))
    for row, (label, trace) in enumerate(zip(labels, traces, strict=False)):
        draw_whole(panel(figure, grid[row, 0], f"trace {label}"), time, trace, canvas.color_of(row))
        _draw_zoom(panel(figure, grid[row, 1], f"{_ZOOM:g} s of it"), time, trace, canvas.color_of(row))
    return figure


def draw_whole(axes: "Axes", time: Floats, trace: Floats, color: str) -> None:
    """Draw one trace from end to end, with its missing stretches open and both labels."""
    angle, unit = angle_scale(float(np.nanmax(np.abs(trace), initial=0.0)))
    draw_band(axes, over_time(axes, time, f"elongation, {unit}"), trace * angle, color=color, label="")


def _draw_zoom(axes: "Axes", time: Floats, trace: Floats, color: str) -> None:
    start = max(0.0, 0.5 * time[-1] - 0.5 * _ZOOM)
    shown = (time >= start) & (time <= start + _ZOOM)
    angle, unit = angle_scale(float(np.nanmax(np.abs(trace), initial=0.0)))
    axes.set(xlabel=f"seconds after {start:.0f} s", ylabel=f"elongation, {unit}")
    if not np.isfinite(trace[shown]).any():
        note(axes, "no reading here")
        return
    # With few readings a line between them would suggest a motion that was not seen.
    style = "-" if shown.sum() > 8 * _ZOOM else "o"
    axes.plot(time[shown] - start, trace[shown] * angle, style, markersize=2.5, color=color)
    axes.set_xlim(0.0, min(_ZOOM, float(time[-1])))


def result_figure(result: DataTree, *, true_gravity: float | None = None) -> "Figure":
    """Draw a result with the group `gravity`; the methods' errors are counted from the true one, m s-2, if given."""
    more = "difference" in result.children
    figure = sheet("Gravity from the difference pendulum", subtitle(result), 11.0, 11.0 if more else 8.2)
    grid = figure.add_gridspec(3 if more else 2, 2)
    draw_amplitudes(panel(figure, grid[0, 0], "Amplitude of each harmonic"), result)
    draw_gravity(panel(figure, grid[0, 1], "Gravity by method"), result, true_gravity)
    draw_track(panel(figure, grid[1, :], "Gravity along the record"), result)
    if more:
        draw_residual(panel(figure, grid[2, 0], "Residual of the difference"), result)
        draw_spectrum(panel(figure, grid[2, 1], "Spectrum of the residual"), result)
    return figure


def subtitle(result: DataTree) -> str:
    """Name the record and the gravity of the best method that gave one."""
    method = best_method(result)
    if method is None:
        return f"{canvas.record_of(result)} · no method gave a gravity"
    gravity, sigma = (float(of_method(result, "gravity", key, method)) for key in ("gravity", "gravity_sigma"))
    return f"{canvas.record_of(result)} · {gravity:.7f} m/s² ± {_rounded(sigma)} mGal by {method}"


def of_method(result: DataTree, group: str, name: str, method: str) -> Floats:
    """Values of a variable for one method."""
    return np.asarray(values(result, group, name)[_labels(result, group, "estimator").index(method)])


def best_method(result: DataTree) -> str | None:
    """The most exact method that gave a finite gravity."""
    labels = _labels(result, "gravity", "estimator")
    given = dict(zip(labels, values(result, "gravity", "gravity"), strict=True))
    return next((name for name in (*BEST_FIRST, *labels) if np.isfinite(given.get(name, np.nan))), None)


def draw_amplitudes(axes: "Axes", result: DataTree) -> None:
    """Draw the amplitude of every component against time."""
    if "phases" not in result.children:
        note(axes, "the result holds no phases")
        return
    sizes = values(result, "phases", "amplitude")
    angle, unit = angle_scale(float(np.nanmax(sizes, initial=0.0)))
    time = over_time(axes, _seconds(result), f"amplitude, {unit}")
    every = slice(None, None, max(1, time.size // _MOST_POINTS))  # smooth, and drawn in no time
    for row, label in enumerate(_labels(result, "phases", "component")):
        words = f"{'difference' if '-' in label else 'pendulum'} {label}"
        style = ("-", "--", "-")[row % 3]  # two pendulums swing alike and would hide each other
        axes.plot(time[every], sizes[row, every] * angle, style, color=canvas.color_of(row), label=words)
    axes.set_ylim(0.0, 1.25 * robust_limits(sizes * angle)[1])
    legend(axes, loc="upper center", ncols=3)


def draw_track(axes: "Axes", result: DataTree) -> None:
    """Draw the difference's phase speed as the gravity it stands for, before and after its correction, and the band."""
    best = best_method(result)
    if best is None or "correction" not in result.children or "corrected_gravity" not in result["correction"].dataset:
        note(axes, "no method gave a corrected phase speed")
        return
    row = next(k for k, name in enumerate(_labels(result, "phases", "component")) if "-" in name)
    measured = values(result, "phases", "phase_speed")[row]
    gravity, frequency = (of_method(result, "gravity", name, best) for name in ("gravity", "frequency"))
    time = _seconds(result)
    # short against the beats of the swing, long against the reading noise
    width = float(np.clip(round(float(time[-1]) / 450.0) * 10.0, 5.0, 60.0))
    across = over_time(axes, time, f"mGal from {float(gravity):.7f} m/s²\n(means of {width:g} s, twice)")
    lines = {
        "phase speed as measured": (gravity * (measured / frequency[-1]) ** 2, canvas.VERMILION),
        f"corrected ({best})": (of_method(result, "correction", "corrected_gravity", best), canvas.BLUE),
    }
    shown, every = [], slice(None, None, max(1, time.size // _MOST_POINTS))
    for name, (line, color) in lines.items():
        offset = canvas.running_mean(time, (line - gravity) / _MILLIGAL, width)
        offset = canvas.running_mean(time, offset, width)  # once would let a heave of ten seconds through
        if time[-1] > 4.0 * width:  # at the ends half a window is not a mean over whole waves
            offset[(time < width) | (time > time[-1] - width)] = np.nan
        axes.plot(across[every], offset[every], color=color, label=name)
        shown.append(robust_limits(offset))
    if "course" in result.children:
        offset = (values(result, "course", "gravity_course") - gravity) / _MILLIGAL
        sigma = values(result, "course", "gravity_course_sigma")
        axes.fill_between(across, offset - sigma, offset + sigma, color=canvas.GREEN, alpha=0.3, linewidth=0)
        axes.plot(across, offset, color=canvas.GREEN, label="joint, along the track, ± 1 σ")
        shown.append(robust_limits(np.concatenate([offset - sigma, offset + sigma])))
    low, high = min(limits[0] for limits in shown), max(limits[1] for limits in shown)
    axes.set_ylim(low, high + 0.25 * (high - low))
    axes.axhline(0.0, color="black", linewidth=0.7, linestyle=":")
    legend(axes, loc="upper right", ncols=3)


def draw_residual(axes: "Axes", result: DataTree) -> None:
    """Draw what the fit leaves of the difference at the record's own times."""
    time, residual = (values(result, "difference", name) for name in ("record_time", "residual"))
    if not np.isfinite(residual).any():
        note(axes, "no reading was fitted")
        return
    angle, unit = angle_scale(float(np.nanmax(np.abs(residual))))
    across = over_time(axes, time - time[0], f"read less fitted, {unit}")
    size = float(np.sqrt(np.nanmean(residual**2)))
    draw_band(axes, across, residual * angle, color=canvas.BLUE, label=f"rms {size * angle:.3g} {unit}")
    legend(axes, loc="upper right")


def draw_spectrum(axes: "Axes", result: DataTree) -> None:
    """Draw the residual's power spectral density, and where the pendulum swings."""
    frequency, density = (values(result, "spectrum", name)[1:] for name in ("frequency", "residual_spectrum"))
    if not density.size or not density.max() > 0.0:
        note(axes, "nothing is left")
        return
    axes.loglog(frequency, density, color=canvas.BLUE)
    best = best_method(result)
    if best is not None:
        swing = float(of_method(result, "gravity", "frequency", best)[-1]) / (2.0 * np.pi)
        axes.axvline(swing, color=canvas.VERMILION, linewidth=1.0, linestyle="--", label=f"swing, {swing:.3f} Hz")
        legend(axes, loc="best")
    axes.set(xlabel="frequency, Hz", ylabel="power density, rad²/Hz")


def draw_gravity(axes: "Axes", result: DataTree, true_gravity: float | None) -> None:
    """Draw each method's gravity with its sigma, from truth or from the best method, with the numbers."""
    best = best_method(result)
    if best is None:
        note(axes, "no method gave a gravity")
        return
    origin = float(of_method(result, "gravity", "gravity", best)) if true_gravity is None else true_gravity
    methods = _labels(result, "gravity", "estimator")
    offset = (values(result, "gravity", "gravity") - origin) / _MILLIGAL
    sigma = values(result, "gravity", "gravity_sigma")
    rows, good = np.arange(len(methods))[::-1], np.isfinite(offset)
    bars = np.where(np.isfinite(sigma), sigma, 0.0)
    sizes = np.abs(np.concatenate([offset, bars]))
    # half-width of the linear part of the scale: a power of ten below which methods are not to be distinguished
    smallest = 10.0 ** np.floor(np.log10(max(np.percentile(sizes[sizes > 0.0], 20), 1e-4))) if sizes.any() else 1e-3
    axes.set_xscale("symlog", linthresh=smallest, linscale=0.6)
    axes.axvline(0.0, color=canvas.GREEN, linewidth=1.2)
    axes.errorbar(offset[good], rows[good], xerr=bars[good], fmt="o", color=canvas.BLUE, capsize=3, markersize=5)
    told = [f"{_rounded(shift, '+')} ± {_rounded(size)}" for shift, size in zip(offset, sigma, strict=True)]
    labels = [f"{name}\n{told[row] if good[row] else 'refused'}" for row, name in enumerate(methods)]
    axes.set_yticks(rows, labels)
    largest = float(np.max(np.abs(offset[good]) + bars[good], initial=smallest))
    axes.set(xlim=(-2.0 * largest, 2.0 * largest), ylim=(-0.6, len(methods) - 0.4))
    # few decades either side: the labels of all of them, and of the first beside zero, would run into each other
    whole = int(np.log10(largest / smallest))
    decades = smallest * 10.0 ** np.array([whole // 2, whole] if whole > 2 else [whole])
    axes.set_xticks([*-decades[::-1], 0.0, *decades])
    axes.xaxis.set_major_formatter(lambda tick, _place: _rounded(tick))
    axes.minorticks_off()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("error, mGal (log scale)" if true_gravity is not None else f"mGal from {best} (log scale)")


def _rounded(size: float, sign: str = "") -> str:
    """Two digits of a size, hundreds in full (240, not 2.4e+02), with a typographic minus as the axes have it."""
    return f"{float(f'{size:.2g}'):{sign if size else ''}g}".replace("-", "−")


def _labels(tree: DataTree, group: str, name: str) -> list[str]:
    return [str(label) for label in tree[group].dataset[name].values]


def _seconds(tree: DataTree) -> Floats:
    time = values(tree, "/", "time")
    return np.asarray(time - time[0])


def demo_figure(record: DataTree, result: DataTree, true_gravity: float) -> "Figure":
    """Draw a record and its result on one sheet; the methods' errors are counted from the true gravity, m s-2."""
    time, traces = _seconds(record), values(record, "record", "elongation")
    figure = sheet("From a ship's record to gravity", subtitle(result), 12.0, 10.0)
    grid = figure.add_gridspec(3, 2)
    for column, label in enumerate(_labels(record, "record", "trace")[:2]):
        kind = "the difference" if "-" in label else "a single pendulum"
        axes = panel(figure, grid[0, column], f"Recorded: {kind}, trace {label}")
        draw_whole(axes, time, traces[column], canvas.color_of(2 * column))
    draw_amplitudes(panel(figure, grid[1, 0], "Amplitude of each harmonic"), result)
    draw_gravity(panel(figure, grid[1, 1], "Error of each method"), result, true_gravity)
    draw_track(panel(figure, grid[2, :], "Gravity along the record"), result)
    return figure


def period_figure(result: DataTree) -> "Figure":
    """Draw a result with the group `period`: period against amplitude above, what the law leaves of it below."""
    table = result.children["period"].to_dataset(inherit=False)
    period, sigma = float(table["period"]), float(table["period_sigma"])
    amplitude, cycles = table["amplitude"].values, table["cycle_period"].values
    reach = 1.03 * float(np.nanmax(amplitude))
    words = f"at infinitesimal arc {period:.6f} s ± {sigma:.2g} s · {table.sizes['cycle']} cycles"
    figure = sheet("Period of a single pendulum against its arc", f"{canvas.record_of(result)} · {words}", 11.0, 7.2)
    grid = figure.add_gridspec(2, 1, height_ratios=(1.5, 1))
    axes = panel(figure, grid[0], "Cycle by cycle", "", "full period, s")
    axes.plot(amplitude, cycles, "o", markersize=2.2, color=canvas.GREY, alpha=0.6, label="one cycle")
    if "cycle_period_smoothed" in table:
        axes.plot(amplitude, table["cycle_period_smoothed"].values, color=canvas.BLUE, label="smoothed")
    arc = np.linspace(0.0, reach, 300)
    law = period * arc_factor(arc)
    axes.plot(arc, law, "--", color=canvas.VERMILION, label="finite-arc law (elliptic integral)")
    axes.set(xlim=(0.0, reach), ylim=robust_limits(np.concatenate([cycles, law])))
    legend(axes, loc="upper left")
    _draw_remainder(panel(figure, grid[1], "What the law leaves", "", "period / law − 1, %"), table, period, reach)
    return figure


def _draw_remainder(axes: "Axes", table: Dataset, period: float, reach: float) -> None:
    amplitude, cycles = table["amplitude"].values, table["cycle_period"].values
    scales = {"amplitude as recorded": (1.0, canvas.GREY)}
    if "amplitude_scale" in table and "amplitude-scale" in table["flag"].values:
        scale = 1.0 + float(table["amplitude_scale"])
        scales[f"amplitude times {scale:.4f}, as fitted"] = (scale, canvas.BLUE)
    shown = []
    for label, (scale, color) in scales.items():
        remainder = 100.0 * (cycles / arc_factor(scale * amplitude) / period - 1.0)
        axes.plot(amplitude, remainder, "o", markersize=2.2, color=color, label=label)
        shown.append(remainder)
    axes.axhline(0.0, color="black", linewidth=0.7)
    axes.axhspan(-0.1, 0.1, color=canvas.ORANGE, alpha=0.18, linewidth=0)
    axes.annotate("±0.1 %", (1.005, 0.0), xycoords=("axes fraction", "data"), va="center", fontsize=8.5)
    # Where the swing has nearly died its cycles scatter most: they must not press all others onto one line.
    every = np.concatenate(shown)
    low, high = np.array(robust_limits(every, hidden=4.0)).clip([-np.inf, 0.25], [-0.25, np.inf]).tolist()
    outside = int(((every < low) | (every > high)).sum())
    words = "amplitude, rad" + (f" ({outside} points lie beyond the frame)" if outside else "")
    axes.set(xlim=(0.0, reach), ylim=(low, high), xlabel=words)
    legend(axes, loc="lower right", ncols=2)


def synchrony_figure(result: DataTree) -> "Figure":
    """Draw a result with the group `synchrony`: phase differences in turns, verdicts, amplitudes, Allan deviations."""
    table = result["synchrony"].dataset
    time = values(result, "/", "time")
    pairs = zip(*(table[name].values for name in ("pair", "verdict", "confidence")), strict=True)
    told = [f"{pair} {verdict} ({100.0 * float(sure):.1f} %)" for pair, verdict, sure in pairs]
    figure = sheet("Clocks that share a support", f"{canvas.record_of(result)} · {', '.join(told)}", 11.0, 7.6)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.3, 1))
    _differences(panel(figure, grid[0, :], "Phase of one less the other", "time, s", "turns"), time, table)
    sizes = panel(figure, grid[1, 0], "Amplitudes", "time, s", "rad")
    steady = panel(figure, grid[1, 1], "How steady each clock is", "averaging time, s", "Allan deviation of the rate")
    for k, label in enumerate(str(each) for each in table["clock"].values):
        sizes.plot(time, table["amplitude"].values[k], color=canvas.color_of(k), label=f"clock {label}")
        if "allan_deviation" in table:
            taus = table["averaging_time"].values
            steady.loglog(taus, table["allan_deviation"].values[k], "o-", markersize=3, color=canvas.color_of(k))
    legend(sizes)
    if "allan_deviation" not in table:
        note(steady, "too short")
    return figure


def _differences(axes: "Axes", time: np.ndarray, table: Dataset) -> None:
    turns = table["phase_difference"].values / (2.0 * np.pi)
    for k, pair in enumerate(str(each) for each in table["pair"].values):
        color, shown = canvas.color_of(k), turns[k] - np.floor(np.nanmin(turns[k]))
        axes.plot(time, shown, color=color, label=pair)
        since = float(table["lock_time"].values[k])
        if np.isfinite(since):
            axes.axvline(since, color=color, linestyle=":", linewidth=1.0)
    low, high = axes.get_ylim()
    wider = max(_LEAST_REACH - 0.5 * (high - low), 0.0)
    low, high = axes.set_ylim(low - wider, high + wider)
    for quarter in range(int(np.ceil(4.0 * low)), int(np.floor(4.0 * high)) + 1) if high - low < 4.0 else ():
        axes.axhline(0.25 * quarter, color=canvas.GREY, linewidth=0.6, linestyle="--")
        place, word = (1.005, 0.25 * quarter), _MARKS[quarter % 4]
        axes.annotate(word, place, xycoords=("axes fraction", "data"), va="center", fontsize=8)
    legend(axes)
