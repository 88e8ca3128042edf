"""Suite `corrections`: what every method leaves (mGal) on every kind of record, and what it costs.

On noise-free linear pendulums it is known which method is right and by how much, to the order of magnitude, the others
are wrong: by their root mean square over several swells, as it depends on phases. On real pendulums a value is judged
by its own sigma; a flag excuses no error. With a folder: every point (CSV), a picture, and finished records.
"""

import functools
import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.benchmarks.honesty import reduced
from pipeline.benchmarks.records import Made, record
from pipeline.benchmarks.scenes import made, real_heave, resonant, swell, two_pendulums
from pipeline.benchmarks.tables import Row, kept, progress, rms, write
from pipeline.methods import PAIR_METHODS
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, draws, legend, panel, save, sheet
from pipeline.processing import process
from synth import simulate

SWELLS = (24, 25, 26, 27, 28, 29)  # seeds of the swell; the records that are shown have the first
METHODS = (*PAIR_METHODS, "joint")
HONEST = {"general": 0.1, "shooting": 0.005, "joint": 0.005}
"""Methods that reduce what acts on real pendulums, and what is promised without noise, mGal, beyond their sigma."""
SIGMAS = 5.0
MARKS: Mapping[str, tuple[str, str]] = {
    "uncorrected": (SKY, "v"), "vening-meinesz": (VERMILION, "^"), "panteleev": (ORANGE, "s"), "general": (BLUE, "D"),
    "complex": (PURPLE, "P"), "projection": (GREEN, "X"), "shooting": ("#000000", "o"), "joint": ("#8c510a", "H"),
}  # fmt: skip
"""Method -> colour, mark."""
FLOOR, TOP = 1e-9, 1e5  # mGal; below the floor lies rounding


@dataclass(frozen=True)
class Kind:
    """One kind of record."""

    name: str
    record: Callable[[int], Made]  # of the seed of the swell
    right: Mapping[str, float] = field(default_factory=dict)  # largest error, mGal, of the methods that are right here
    wrong: Mapping[str, float] = field(default_factory=dict)
    """Least root mean square error over the swells, mGal, of the methods that are wrong: a fifth of what is found."""
    refused: tuple[str, ...] = ()  # methods that may decline: a phase means nothing where the amplitude vanishes
    real: bool = False  # real pendulums, where a value of the methods made for them must hold within its sigma


def _linear(difference: float, *more: dict[str, Any], **changes: Any) -> Callable[[int], Made]:
    return lambda seed: made(two_pendulums("linear", difference, motion=[swell(seed=seed), *more], **changes))


def _wrong(uncorrected: float, vening_meinesz: float) -> Mapping[str, float]:
    return {"uncorrected": uncorrected, "vening-meinesz": vening_meinesz}


_EXACT = {"projection": 1e-3, "complex": 1e-2}
_INTEGRATED = _EXACT | {"panteleev": 1e-2, "general": 1e-2}
_PHASE_METHODS = ("uncorrected", "vening-meinesz", "panteleev", "general")
_EQUAL_ARCS = _linear(1e-3, amplitudes=(0.01, 0.01))
LINEAR = (
    Kind("linear, eps 1e-5, near-resonant", _linear(1e-5, resonant()), _INTEGRATED, _wrong(0.9, 0.6)),
    Kind("linear, eps 1e-4", _linear(1e-4), _INTEGRATED, _wrong(2.8, 8.0)),
    Kind("linear, eps 1e-3", _linear(1e-3), _EXACT | {"panteleev": 0.1}, _wrong(13.0, 260.0)),
    Kind("linear, eps 1e-4, 50/40 mrad", _linear(1e-4, amplitudes=(0.05, 0.04)), _INTEGRATED, _wrong(26.0, 10.0)),
    Kind("linear, eps 1e-3, beats through zero", _EQUAL_ARCS, _EXACT, refused=_PHASE_METHODS),
)  # Noise-free linear pendulums in swell; eps is the relative difference of the periods
REAL = (
    "swell", "near-resonant", "heave recorded", "large arcs", "dampings that differ", "reading noise",
    "few samples a swing", "short record",
)  # fmt: skip
"""Kinds of the suite `honesty`, at its middle strength, for the paper's formulas and the exact identities too."""


def kinds(*, quick: bool) -> list[Kind]:
    """All kinds: linear pendulums, then real ones, whose records are shorter when quick."""
    duration = 600.0 if quick else None
    return [*LINEAR, *(Kind(name, partial(record, name, "middle", duration=duration), real=True) for name in REAL)]


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield a row a kind (error of each method, mGal), a refusal, a method (CPU time, errors); quick: shorter."""
    points: list[Row] = []
    for kind in progress(kinds(quick=quick), "corrections"):
        rows = [{"case": kind.name} | row for row in measured(kind, SWELLS[0], METHODS, folder)]
        seeds = SWELLS[1:] if kind.wrong else ()
        others = [row for seed in seeds for row in measured(kind, seed, tuple(kind.wrong), folder)]
        points += rows
        yield judged(kind, rows, others)
    yield from ({key: row[key] for key in ("case", "method", "refused")} for row in points if row["refused"])
    yield from summary(points)
    if folder is not None:
        write(folder / "corrections-points.csv", points)
        if draws():
            draw(points, folder / "corrections.png")


def measured(kind: Kind, seed: int, methods: Sequence[str], folder: Path | None) -> list[Row]:
    """Error against truth, sigma, CPU time from record to result of each method, or why it declined."""

    def make() -> list[Row]:
        made = kind.record(seed)
        return [_timed(made, name) for name in methods]

    what = {"suite": "corrections", "kind": kind.name, "seed": seed, "methods": list(methods)}
    return kept(folder, what, make)


def _timed(made: Made, name: str) -> Row:
    _compile(name)
    row = reduced(made, name)
    told = {key: row[key] for key in ("error_mgal", "sigma_mgal", "flags", "refused")}
    return {"method": name, "ms": math.nan if row["refused"] else 1e3 * row["seconds"]} | told


@functools.cache
def _compile(name: str) -> None:
    """Run a method once on a record that none declines, so that no record is charged with what is compiled."""
    process(simulate(real_heave(duration=300.0))[0], method=name)


def judged(kind: Kind, rows: Sequence[Row], others: Sequence[Row]) -> Row:
    """Errors on the record that is shown, who is silently wrong, whether the pattern holds, `others` counted."""
    errors = {row["method"]: row["error_mgal"] for row in rows}
    silent = [row["method"] for row in rows if kind.real and row["method"] in HONEST and silently_wrong(row)]
    every = [*rows, *others]
    spread = {name: rms([row["error_mgal"] for row in every if row["method"] == name]) for name in kind.wrong}
    pattern = (
        all(abs(errors[name]) <= limit for name, limit in kind.right.items())
        and all(spread[name] >= limit for name, limit in kind.wrong.items())
        and (kind.real or all(math.isfinite(error) or name in kind.refused for name, error in errors.items()))
    )
    return {"case": kind.name, **errors, "silently_wrong": " ".join(silent), "pass": pattern and not silent}


def silently_wrong(row: Row) -> bool:
    """Whether a value lies beyond five of its sigmas and what is promised, flagged or not; refusals are right."""
    return not row["refused"] and not abs(row["error_mgal"]) <= SIGMAS * row["sigma_mgal"] + HONEST[row["method"]]


def summary(points: Sequence[Row]) -> list[Row]:
    """One row a method over all records."""
    table = []
    for name in METHODS:
        rows = [row for row in points if row["method"] == name]
        values = [row for row in rows if not row["refused"]]
        times, errors = ([abs(row[key]) for row in values] or [math.nan] for key in ("ms", "error_mgal"))
        sizes = {"median_ms": statistics.median(times), "median_error_mgal": statistics.median(errors)}
        counts = {"flagged": sum(bool(row["flags"]) for row in rows), "declined": len(rows) - len(values)}
        table.append({"method": name, **sizes, "worst_error_mgal": max(errors), **counts, "records": len(rows)})
    return table


def draw(points: Sequence[Row], path: Path) -> None:
    """Draw |error| against warm run time: every record as a small mark, each method's medians as a large one."""
    words = "small: a record, large: the median of all; from record to result, kernels compiled; dashed: 1 mGal"
    figure = sheet("What each method leaves, and what it costs", words, 14.5, 6.2)
    grid = figure.add_gridspec(1, 2)
    for place, (title, linear) in enumerate((("linear pendulums", True), ("real pendulums", False))):
        axes = panel(figure, grid[place], title, "run time, ms", "|error|, mGal", xscale="log", yscale="log")
        axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
        for method, (colour, mark) in MARKS.items():
            rows = [row for row in points if row["method"] == method and not row["refused"]]
            rows = [row for row in rows if row["case"].startswith("linear") == linear]
            times, errors = [row["ms"] for row in rows], [max(abs(row["error_mgal"]), FLOOR) for row in rows]
            axes.plot(times, errors, mark, color=colour, markersize=4.0, alpha=0.4, markeredgewidth=0)
            if rows:
                time, error = statistics.median(times), statistics.median(errors)
                look: Any = {"color": colour, "markersize": 11, "markeredgecolor": "white", "zorder": 4}
                axes.plot(time, error, mark, label=f"{method}  {time:.0f} ms, {error:.2g} mGal", **look)
        axes.set_ylim(FLOOR / 3, TOP)
        legend(axes, loc="center left", bbox_to_anchor=(1.0, 0.5), title="medians", labelspacing=1.0)
    save(figure, path)
