"""Bars on speed, as ratios within one run."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.benchmarks import propagators, speed
from pipeline.benchmarks.bar import Row, at_least, at_most, not_measured

HEYOKA_RATIO, DOP853_RATIO = 50.0, 5000.0
EXACT = 1e-14
COMPARABLE = 1e-6  # error to which a slow peer's tolerance is set


def rows(*, quick: bool) -> Iterator[Row]:
    """Yield the bars of speed. Quick races are shorter, and there the closed form's fixed cost tells."""
    yield from _race(quick=quick)
    yield from _estimation(quick=quick)
    yield from _start_up(quick=quick)


def _race(*, quick: bool) -> Iterator[Row]:
    found = {row["propagator"]: row for row in propagators.run(quick=quick, folder=None)}
    own = found[propagators.OWN]
    length = f"{own['simulated_s']} s of two linear pendulums"
    yield at_most(f"{length}: error of the closed form ({own['ms']:.3g} ms)", own["error"], EXACT)
    if quick:
        yield not_measured(f"{length}: times faster than peers", ">= 50, >= 5000", "the full run races over an hour")
        return
    for words in ("forcing for each", "shared forcing"):
        rivals = [row for name, row in found.items() if name.startswith(f"{propagators.HEYOKA}, {words}")]
        bar = f"{length}: times faster than {propagators.HEYOKA}, {words}, fastest tolerance"
        if rivals:
            yield at_least(bar, min(row["times_slower"] for row in rivals), HEYOKA_RATIO)
        else:
            yield not_measured(bar, f">= {HEYOKA_RATIO:g}", "not installed: extra 'peers'")
    slow = [row for name, row in found.items() if name.startswith("scipy DOP853") and row["error"] <= COMPARABLE]
    bar = f"{length}: times faster than scipy DOP853 at an error of {COMPARABLE:g}"
    yield at_least(bar, min(row["times_slower"] for row in slow), DOP853_RATIO)


def _estimation(*, quick: bool) -> Iterator[Row]:
    for row in speed.estimation(quick=quick):
        if row["error_mgal"] is not None:
            yield at_most(f"{row['what']}: share of the time of {row['rival']}", row["share_of_rival"], 1.0 / 3.0)
            yield at_most(f"{row['what']}: error, noise-free", row["error_mgal"], 1e-6, "mGal")


def _start_up(*, quick: bool) -> Iterator[Row]:
    for row in speed.start_up(quick=quick):
        limit = 3.0 if "--help" in row["what"] else 2.5
        yield at_most(f"{row['what']}, start to exit: times {row['rival']}", row["share_of_rival"], limit)
