"""The sheet every figure is drawn on: size, type, colours, heading, and writing it to a file."""

from __future__ import annotations

import contextlib
import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from data_schemas.errors import FileError, UsageError
from data_schemas.writing import beside, give_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette (2008), told apart by every kind of colour vision; black is for text and zero lines.
BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9", "#CC79A7"
PALETTE = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY)
GREY = "#666666"

_STYLE: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.2,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
}
_DOTS_PER_INCH = 130


def require_matplotlib() -> None:
    """Raise `UsageError` with the remedy if the extra `plot` is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise UsageError("plotting needs matplotlib, which is not installed; pip install 'isochrony[plot]'")


def sheet(title: str, subtitle: str, width: float, height: float) -> Figure:
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


def panel(figure: Figure, place: Any, title: str, across: str = "", up: str = "", **settings: Any) -> Axes:
    """Add one panel with its title and both labels.

    Parameters
    ----------
    place : SubplotSpec
        Cell of a grid of the figure.
    title, across, up : str
        Heading, label of the horizontal axis, label of the vertical axis; labels carry their units.
    """
    from matplotlib import rc_context

    with rc_context(_STYLE):
        axes: Axes = figure.add_subplot(place, **settings)
        axes.set_title(title)
        axes.set_xlabel(across)
        axes.set_ylabel(up)
    return axes


def legend(axes: Axes, **settings: Any) -> None:
    """Add the legend in the sheet's style, on white so that grid and lines do not run through its words."""
    axes.legend(fontsize=8.5, frameon=True, framealpha=0.85, edgecolor="none", **settings)


def note(axes: Axes, text: str) -> None:
    """Write a remark in the middle of a panel that has nothing to show."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)
    axes.set_xticks([])
    axes.set_yticks([])


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write the figure as PNG, under a temporary name first: nothing half-written stays; `FileError` where it fails."""
    target = Path(os.path.realpath(path))
    temporary = beside(target)
    try:
        figure.savefig(temporary, format="png", metadata={"Software": "isochrony"})
        give_name(temporary, target, path, overwrite=True)
    except OSError as fault:
        raise FileError(f"{path}: cannot be written ({fault.strerror}); choose another with -o") from fault
    finally:
        with contextlib.suppress(OSError):  # gone already when it was renamed
            temporary.unlink()
