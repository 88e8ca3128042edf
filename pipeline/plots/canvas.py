"""The sheet every figure is drawn on: size, type, colours, heading, writing it to a file; time series kept readable."""

import contextlib
import importlib.util
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.errors import FileError, UsageError
from data_schemas.writing import beside, give_name, place_of
from pipeline.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import DataTree

# Okabe and Ito's palette (2008), told apart by every kind of colour vision; black is for text and zero lines.
BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9", "#CC79A7"
PALETTE = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY)
GREY = "#666666"

_STYLE: dict[Any, Any] = {
    "font.size": 9.5, "axes.labelsize": 9.5, "xtick.labelsize": 8.5, "ytick.labelsize": 8.5, "lines.linewidth": 1.2,
    "axes.titlesize": 10.5, "axes.titleweight": "bold", "axes.titlelocation": "left", "axes.formatter.useoffset": False,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True,
    "grid.color": "#e3e3e3", "grid.linewidth": 0.7,
}  # fmt: skip
_DOTS_PER_INCH = 130
_BINS = 700  # about one a pixel column


def color_of(number: int) -> str:
    """Colour of the trace, clock or method of a number, counted from 0."""
    return PALETTE[number % len(PALETTE)]


def record_of(tree: "DataTree") -> str:
    """Name the record in a heading."""
    return f"record {tree.attrs.get('record_id', 'without a name')}"


def values(tree: "DataTree", group: str, name: str) -> Floats:
    """Values of a variable of a group."""
    return np.asarray(tree[group].dataset[name].values, dtype=np.float64)


def draws() -> bool:
    """Whether pictures can be drawn: matplotlib is an extra."""
    return importlib.util.find_spec("matplotlib") is not None


def require_matplotlib() -> None:
    """Raise `UsageError` with the remedy if the extra `plot` is not installed."""
    if not draws():
        raise UsageError("plotting needs matplotlib, which is not installed; pip install 'isochrony[plot]'")


def sheet(title: str, subtitle: str, width: float, height: float) -> "Figure":
    """Make an empty figure, width by height inches, with its heading: what it shows, and of which record."""
    require_matplotlib()
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), dpi=_DOTS_PER_INCH)
        FigureCanvasAgg(figure)
        # An inch is kept for the heading; the layout engine fills the rest.
        engine = ConstrainedLayoutEngine(rect=(0.005, 0.005, 0.99, 1.0 - 0.74 / height))
        figure.set_layout_engine(engine)
        left = 0.12 / width
        figure.text(left, 1.0 - 0.12 / height, title, fontsize=13, fontweight="bold", va="top")
        figure.text(left, 1.0 - 0.40 / height, subtitle, fontsize=9.5, color=GREY, va="top")
    return figure


def panel(figure: "Figure", place: Any, title: str, across: str = "", up: str = "", **settings: Any) -> "Axes":
    """Add one panel in a cell of a grid of the figure: heading, labels of both axes with their units."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        axes: Axes = figure.add_subplot(place, **settings)
        axes.set(title=title, xlabel=across, ylabel=up)
    return axes


def legend(axes: "Axes", **settings: Any) -> None:
    """Add the legend in the sheet's style, on white so that grid and lines do not run through its words."""
    axes.legend(fontsize=8.5, frameon=True, framealpha=0.85, edgecolor="none", **settings)


def note(axes: "Axes", text: str) -> None:
    """Write a remark in the middle of a panel that has nothing to show."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)
    axes.set(xticks=[], yticks=[])


def save(figure: "Figure", path: str | os.PathLike[str]) -> None:
    """Write the figure as PNG, under a temporary name first: nothing half-written stays; `FileError` where it fails."""
    from matplotlib.text import Text

    target = place_of(path)
    temporary = beside(target)
    axes = [axis for each in figure.axes for axis in (each.xaxis, each.yaxis)]
    ticks = {id(label) for axis in axes for label in axis.get_ticklabels(which="both")}
    for text in figure.findobj(Text):
        if id(text) not in ticks:  # what files say is no formula
            text.set_parse_math(False)
            text.set_text("".join(each if each.isprintable() or each == "\n" else "?" for each in text.get_text()))
    try:
        figure.savefig(temporary, format="png", metadata={"Software": "isochrony"})
        give_name(temporary, target, path, overwrite=True)
    except OSError as fault:
        raise FileError(f"{path}: cannot be written ({fault.strerror}); choose another with -o") from fault
    finally:
        with contextlib.suppress(OSError):  # gone already when it was renamed
            temporary.unlink()


def angle_scale(largest: float) -> tuple[float, str]:
    """Factor from radians and the unit's name that suit angles up to the largest.

    >>> angle_scale(0.02), angle_scale(1.6), angle_scale(2e-5)
    ((1000.0, 'mrad'), (1.0, 'rad'), (1000000.0, 'µrad'))
    """
    if largest >= 0.3:
        return 1.0, "rad"
    return (1e3, "mrad") if largest >= 2e-4 else (1e6, "µrad")


def time_scale(longest: float) -> tuple[float, str]:
    """Factor from seconds and the unit's name that suit a record of that length.

    >>> time_scale(136.0), time_scale(1800.0)
    ((1.0, 's'), (0.016666666666666666, 'min'))
    """
    if longest <= 300.0:
        return 1.0, "s"
    return (1.0 / 60.0, "min") if longest <= 4 * 3600.0 else (1.0 / 3600.0, "h")


def over_time(axes: "Axes", time: Floats, up: str) -> Floats:
    """Label both axes of a panel over the time from the start, s; return that time in the unit that suits."""
    factor, unit = time_scale(float(time[-1]))
    axes.set(xlim=(0.0, time[-1] * factor), xlabel=f"time from the start, {unit}", ylabel=up)
    return np.asarray(time * factor)


def draw_band(axes: "Axes", time: Floats, values: Floats, *, color: str, label: str) -> None:
    """Fill from least to greatest of each pixel column, gaps apart: thousands of swings would be a solid block."""
    if time.size <= 2 * _BINS:
        axes.plot(time, values, color=color, label=label, linewidth=0.8)
        return
    edges = np.linspace(time[0], time[-1], _BINS + 1)
    bins = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, _BINS - 1)
    low, high = np.full(_BINS, np.inf), np.full(_BINS, -np.inf)
    good = np.isfinite(values)
    np.minimum.at(low, bins[good], values[good])
    np.maximum.at(high, bins[good], values[good])
    middle = 0.5 * (edges[:-1] + edges[1:])
    axes.fill_between(middle, low, high, where=low <= high, color=color, alpha=0.85, linewidth=0.3, label=label)


def running_mean(time: Floats, values: Floats, width: float) -> Floats:
    """Mean over `width` seconds about each instant, NaN where there is no value: single seconds are mostly noise."""
    import pandas as pd

    series = pd.Series(values, pd.to_timedelta(time, unit="s"))
    means = series.rolling(pd.Timedelta(width, unit="s"), min_periods=1, center=True, closed="both").mean()
    return np.array(means.where(series.notna()))


def robust_limits(values: Floats, *, hidden: float = 0.5, margin: float = 0.15) -> tuple[float, float]:
    """Limits that show all but the wildest values (`hidden` per cent at each end), which would hide the rest."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return -1.0, 1.0
    low, high = np.percentile(finite, [hidden, 100.0 - hidden])
    spread = max(high - low, 1e-9 * max(abs(low), abs(high), 1e-300))
    return float(low - margin * spread), float(high + margin * spread)
