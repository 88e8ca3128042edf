"""A film and what was read of it: the image in strips, one under the other, with traces, marks and flags on it."""

from itertools import pairwise
from textwrap import shorten
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from data_schemas.errors import UsageError
from data_schemas.variables import ELONGATION_FLAGS
from pipeline.arrays import Floats, row_means_present
from pipeline.film.reading import Reading, accepted_fraction, share_read
from pipeline.film.scan.opening import OpenScan
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, panel, sheet

_IMAGE_HEIGHT = 900  # dots across the film, at most
_LEAST_CONTRAST = 0.1  # of full scale: the grain of blank film is not stretched to black and white
_STRIP = 30.0  # s of film a strip, if that makes no more than the most
_MOST_STRIPS = 12
_WIDTH, _HEIGHT = 15.0, 20.0  # inches, of all strips
_DOTS = 1750  # across a strip
_IMAGE: Any = {"origin": "lower", "aspect": "auto", "interpolation": "none"}
_FINE = 2.0  # rows to a dot up to which single readings are drawn
_TRACES = (BLUE, VERMILION, GREEN, PURPLE)
_FLAGS = {
    "ambiguous": VERMILION, "lost": PURPLE, "single_direction": ORANGE, "overlap": SKY, "gap": GREY,
    "saturated": GREEN,
}  # fmt: skip


class Strip(NamedTuple):
    """A piece of film: rows `first` to `stop`, columns `left` to `right`."""

    first: int
    stop: int
    left: int
    right: int


def film_figure(reading: Reading, start: float | None = None, stop: float | None = None) -> Figure:
    """Draw a film, time to the right, and what was read, from `start` to `stop`, s; `UsageError`: nothing then."""
    rows, samples = _rows(reading, start, stop), reading.samples.column
    seconds = reading.axis.seconds
    known = np.flatnonzero(np.isfinite(seconds))
    per_row = float(np.ptp(seconds[known[[0, -1]]]) / np.ptp(known)) if known.size > 1 else 0.0
    part = share_read(reading.kind, accepted_fraction(reading.tracks, reading.axis), float(np.isnan(samples).mean()))
    told = part, f"{reading.marks.size} marks", f"{reading.kind} reading", ", ".join(reading.flags) or "no flags"
    words = " · ".join([", ".join(path.name for path in reading.scan.paths), *told])
    figure, strips = _sheet(reading.scan, "Film, and what was read of it", words, rows, _reach(reading, *rows), per_row)
    for axes, strip in strips:
        _draw_traces(axes, reading, strip, known)
        _draw_marks(axes, reading, strip)
        _draw_flags(axes, reading, strip)
        _label_time(axes, seconds[strip.first : strip.stop], strip)
    _legend(figure, reading)
    return figure


def unread_figure(scan: OpenScan, why: str) -> Figure:
    """Draw a film that could not be read, and say in one line why."""
    figure, strips = _sheet(
        scan, "Film, not read", shorten(why, 190, placeholder="..."), (0, scan.rows), (0, scan.columns), 0.0
    )
    for axes, strip in strips:
        _label_time(axes, np.empty(0), strip)
    return figure


def _rows(reading: Reading, start: float | None, stop: float | None) -> tuple[int, int]:
    """Rows of a part of the time."""
    if start is None and stop is None:
        return 0, reading.scan.rows
    seconds = reading.axis.seconds
    low, high = -np.inf if start is None else start, np.inf if stop is None else stop
    inside = np.flatnonzero((seconds >= low) & (seconds <= high))
    if inside.size < 8:
        known = seconds[np.isfinite(seconds)]
        begin, end = known[[0, -1]] if known.size else (0.0, 0.0)
        raise UsageError(f"the film reaches from {begin:.1f} to {end:.1f} s; give --from and --to within it")
    return int(inside[0]), int(inside[-1]) + 1


def _reach(reading: Reading, first: int, last: int) -> tuple[int, int]:
    """Columns that the traces reach in some rows, with a margin."""
    places = np.concatenate([reading.tracks.course[:, first:last].ravel(), reading.strobe.position.ravel()])
    places = places[np.isfinite(places)]
    if places.size == 0:
        return 0, reading.scan.columns
    low, high = np.percentile(places, [0.05, 99.95])
    margin = 0.06 * (high - low) + 30.0
    return max(0, int(low - margin)), min(reading.scan.columns, int(high + margin))


def _sheet(
    scan: OpenScan, title: str, words: str, rows: tuple[int, int], columns: tuple[int, int], seconds_per_row: float
) -> tuple[Figure, list[tuple[Axes, Strip]]]:
    """The image in strips of half a minute, a panel for each, as high as the film is wide, within reason."""
    length = _STRIP / seconds_per_row if seconds_per_row > 0.0 else 1800.0
    count = int(np.clip(np.ceil((rows[1] - rows[0]) / length - 0.05), 1, _MOST_STRIPS))
    edges = np.linspace(*rows, count + 1).astype(int).tolist()
    true = (_WIDTH - 1.0) * (columns[1] - columns[0]) / (edges[1] - edges[0])
    height = float(np.clip(true, 1.5, np.clip(_HEIGHT / count, 1.8, 9.0)))
    figure = sheet(title, words, _WIDTH, 1.15 + count * (height + 0.45))
    grid = figure.add_gridspec(count, 1)
    strips = []
    for row, (first, stop) in enumerate(pairwise(edges)):
        axes, strip = panel(figure, grid[row, 0], "", up="column"), Strip(first, stop, *columns)
        axes.grid(False)
        grey = picture(scan, *strip, _DOTS)
        axes.imshow(grey.T, **_IMAGE, extent=(first, stop, *columns), cmap="gray", vmin=0.0, vmax=1.0)
        strips.append((axes, strip))
    return figure, strips


def _draw_traces(axes: Axes, reading: Reading, strip: Strip, known: NDArray[np.int64]) -> None:
    """Readings as dots where there is room for them, the course as a line, thin through the gaps; places read at the
    marks as rings.
    """
    tracks, axis, strobe = reading.tracks, reading.axis, reading.strobe
    rows = np.arange(strip.first, strip.stop)
    marked = known.size > 1 and (reading.kind == "strobe" or rows.size * 4 <= _DOTS)
    at = np.interp(strobe.index * axis.interval, axis.seconds[known], known + 0.5, np.nan, np.nan) if marked else None
    for trace, course in enumerate(tracks.course[:, rows]):
        color = _TRACES[trace % len(_TRACES)]
        axes.plot(rows + 0.5, course, color=color, linewidth=0.5, alpha=0.55)
        if rows.size <= _FINE * _DOTS:
            size, position = float(np.clip(2.5 * _DOTS / rows.size, 0.8, 5.0)), tracks.position[trace, rows]
            axes.plot(rows + 0.5, position, ".", color=color, markersize=size, markeredgewidth=0)
        if at is not None:
            ring: Any = {"markersize": 4, "fillstyle": "none", "markeredgewidth": 0.8, "color": color}
            column = strobe.position[trace]
            axes.plot(at + axis.offset[trace] + axis.shear * column, column, "o", **ring)


def _draw_marks(axes: Axes, reading: Reading, strip: Strip) -> None:
    """Marks as ticks along the upper edge, full minutes long and named."""
    axis, seen = reading.axis, reading.marks
    rows = np.interp(seen, axis.index, axis.row)
    per_minute = round(60.0 / axis.interval)
    top, span = strip.right, strip.right - strip.left
    shown = (rows >= strip.first) & (rows < strip.stop)
    axes.vlines(rows[shown], top - 0.02 * span, top, color="black", linewidth=0.6)
    for row, index in zip(rows[shown], seen[shown], strict=True):
        if index % per_minute == 0:
            axes.vlines(row, top - 0.07 * span, top, color="black", linewidth=1.6)
            label = f" {index * axis.interval / 60.0:g} min"
            axes.text(row, top - 0.01 * span, label, fontsize=8.5, va="top", fontweight="bold", clip_on=True)


def _draw_flags(axes: Axes, reading: Reading, strip: Strip) -> None:
    """Each trace's flags as a bar along the lower edge."""
    flags, wide = reading.row_flags[:, strip.first : strip.stop], strip.right - strip.left
    high = 0.055 * wide / len(flags)
    for trace, qc in enumerate(flags):
        worst = [np.bitwise_or.reduce(block) for block in np.array_split(qc, min(_DOTS, qc.size))]
        names = [next((name for name in _FLAGS if flag & ELONGATION_FLAGS[name]), "") for flag in worst]
        colors = [[to_rgb(_FLAGS.get(name, "white")) for name in names]]
        low = strip.left - 0.06 * wide + trace * high
        axes.imshow(colors, **_IMAGE, extent=(strip.first, strip.stop, low, low + high))
        axes.axhline(low + high, color=_TRACES[trace % len(_TRACES)], linewidth=0.6)


def _label_time(axes: Axes, seconds: Floats, strip: Strip) -> None:
    """Seconds of a strip's rows along the lower edge, rows where no time is known; room for the flags above it."""
    axes.set(xlim=(strip.first, strip.stop), ylim=(strip.left - 0.06 * (strip.right - strip.left), strip.right))
    known = np.flatnonzero(np.isfinite(seconds))
    if known.size < 2:
        axes.set_xlabel("row")
        return
    begin, end = seconds[known[[0, -1]]].tolist()
    ticks = MaxNLocator(15, steps=[1, 2, 5, 10]).tick_values(begin, end)
    ticks = ticks[(ticks >= begin) & (ticks <= end)]
    rows = np.interp(ticks, seconds[known], known + strip.first + 0.5)
    axes.set_xticks(rows, [f"{tick:g} s" for tick in ticks])


def _legend(figure: Figure, reading: Reading) -> None:
    """Colours of traces and flags, beside the heading."""
    handles: list[Any] = [
        Line2D([], [], color=_TRACES[trace % len(_TRACES)], label=f"trace {trace + 1} from the left")
        for trace in np.argsort(row_means_present(reading.tracks.course))
    ]
    raised = int(np.bitwise_or.reduce(reading.row_flags, axis=None))
    flags = {name: color for name, color in _FLAGS.items() if raised & ELONGATION_FLAGS[name]}
    handles += [Patch(color=color, label=name.replace("_", " ")) for name, color in flags.items()]
    # at most five to a row: they share the height with the heading
    columns = -(-len(handles) // 2) if len(handles) > 5 else len(handles)
    figure.legend(handles=handles, loc="upper right", ncols=columns, fontsize=8.5, frameon=False, borderaxespad=0.4)


def picture(scan: OpenScan, first: int, stop: int, left: int, right: int, dots: int) -> NDArray[np.float32]:
    """Grey from 0 (black) to 1 of rows `first` to `stop`, columns `left` to `right`, at most (dots, 900).

    A dot that covers several pixels is halfway between their mean and their darkest. The contrast is stretched from
    the darkest lines to the blank film.
    """
    down = max(1, -(-(stop - first) // dots))
    across = max(1, -(-(right - left) // _IMAGE_HEIGHT))
    rows, columns = (stop - first) // down, (right - left) // across
    shown = np.empty((rows, columns), dtype=np.float32)
    step = max(1, 1024 // down)
    for a in range(0, rows, step):
        b = min(rows, a + step)
        pixels = scan.read(first + a * down, first + b * down)[:, left : left + columns * across]
        blocks = pixels.reshape(b - a, down, columns, across)
        shown[a:b] = blocks.mean(axis=(1, 3), dtype=np.float32)
        if down * across > 1:
            shown[a:b] = 0.5 * (shown[a:b] + blocks.min(axis=(1, 3)))
    dark, blank = np.percentile(shown, [0.05, 60.0])
    contrast = max(float(blank - dark), _LEAST_CONTRAST * scan.full_scale)
    return np.asarray(np.clip(0.95 - 0.87 * (blank - shown) / contrast, 0.0, 1.0), dtype=np.float32)
