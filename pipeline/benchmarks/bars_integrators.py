"""Bars on the integrators: times faster than peers at equal or smaller error, on points of one run.

CyRK has two faces. Its DOP853 is judged by the usual one, called from Python, on which the bars were set, and the one
called from compiled code is reported; its RADAU is judged by both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from pipeline.benchmarks import ensemble_race
from pipeline.benchmarks.bar import Row, at_least, not_measured, reported
from pipeline.benchmarks.curves import of, own, time_at
from pipeline.benchmarks.own import OWN
from pipeline.benchmarks.problems import Problem, problems
from pipeline.benchmarks.references import reference
from pipeline.benchmarks.work_precision import Point, contenders, sweep

ABSENT = "not installed, or did not reach it: extra 'peers'"
LEVEL = 1e-9
_FACES = ("CyRK RADAU, Python face", "CyRK RADAU")
_WANTED = ("heyoka", "CyRK DOP853", "CyRK DOP853, Python face", "CyRK RADAU", "CyRK RADAU, Python face", "scipy Radau")


def rows(*, quick: bool) -> Iterator[Row]:
    """Measure what the bars need and yield them; quick problems are a tenth as long."""
    found = {}
    for name, problem in problems(quick=quick).items():
        found[name] = sweep(problem, reference(problem), quick=quick, names=rivals(problem))
    found[ensemble_race.NAME] = ensemble_race.race(quick=quick)[2]
    yield from not_judged(judged(found)) if quick else judged(found)


def rivals(problem: Problem) -> list[str]:
    """All propagators of the project, and the peers that bars are set on."""
    return [each for each in contenders(problem) if each in OWN or each in _WANTED]


def not_judged(rows: Iterator[Row]) -> Iterator[Row]:
    """Rows of short problems, on which starting up is what takes the time: told, not judged."""
    for row in rows:
        yield row | {"limit": f"of the full run: {row['limit']}", "pass": None}


def judged(found: Mapping[str, Sequence[Point]]) -> Iterator[Row]:
    """Bars from the points of the suite; two limits are the bar and the goal, which is reported."""
    yield from _linear(found["linear"])
    yield from _nonlinear(found["nonlinear"])
    yield from _at_level("beam", "heyoka", found["beam"], 1.5, 3.0)
    yield from _at_level(ensemble_race.NAME, ensemble_race.BATCH, found[ensemble_race.NAME], 1.0, 2.0)
    for name in ("van der Pol", "stiff beam"):
        yield from _stiff(name, found[name])


def _linear(points: Sequence[Point]) -> Iterator[Row]:
    bar = "linear at <= 1e-14: times faster than"
    yield _times(f"{bar} heyoka at any tolerance", points, _fastest(of(points, "heyoka")), 50.0, 100.0, 1e-14)
    for name, judge in (("CyRK DOP853, Python face", True), ("CyRK DOP853", False)):
        rival = _at(points, name, 1e-6)
        yield _times(f"{bar} {name} at 1e-6", points, rival, 250.0, 400.0, 1e-14, judge=judge)


def _nonlinear(points: Sequence[Point]) -> Iterator[Row]:
    for name, tolerance, limit, goal, judge in (
        ("heyoka", 1e-12, 8.0, 20.0, True),
        ("CyRK DOP853, Python face", 1e-9, 50.0, 150.0, True),
        ("CyRK DOP853", 1e-9, 50.0, 150.0, False),
    ):
        bar = f"nonlinear at <= 1e-11: times faster than {name} at {tolerance:g}"
        yield _times(bar, points, _at(points, name, tolerance), limit, goal, 1e-11, judge=judge)


def _at_level(name: str, peer: str, points: Sequence[Point], limit: float, goal: float) -> Iterator[Row]:
    """Both curves at the same error."""
    theirs = time_at(of(points, peer), LEVEL)
    method, mine = _own_time(points, LEVEL)
    bar = f"{name} at an error of {LEVEL:g}: times faster than {peer} (goal {goal:g})"
    if math.isnan(theirs):
        yield not_measured(bar, f">= {limit:g}", ABSENT)
    else:
        yield at_least(f"{bar}: {method} {mine:.3g} ms, it {theirs:.3g} ms", theirs / mine, limit)


def _stiff(name: str, points: Sequence[Point]) -> Iterator[Row]:
    for tolerance, limit, goal in ((1e-6, 1.4, 3.0), (1e-9, 1.4, 3.0), (1e-12, 3.0, 8.0)):
        for peer in _FACES:
            bar = f"{name}: times faster than {peer} at {tolerance:g}"
            yield _times(bar, points, _at(points, peer, tolerance), limit, goal)
    if name == "van der Pol":
        for tolerance in (1e-6, 1e-9, 1e-12):
            bar = f"{name}: times faster than scipy Radau at {tolerance:g}"
            yield _times(bar, points, _at(points, "scipy Radau", tolerance), 300.0, 1000.0)


def _own_time(points: Sequence[Point], error: float) -> tuple[str, float]:
    """The fastest propagator at an error and its time, ms; NaN where none reaches it."""
    times = {
        method: time_at(of(points, method), error) for method in dict.fromkeys(point.method for point in own(points))
    }
    reached = {method: time for method, time in times.items() if not math.isnan(time)}
    return min(reached.items(), key=lambda item: item[1], default=("none", math.nan))


def _fastest(points: Sequence[Point]) -> Point | None:
    return min(points, key=lambda point: point.ms, default=None)


def _at(points: Sequence[Point], method: str, tolerance: float) -> Point | None:
    """The method's point at a tolerance."""
    return next((point for point in of(points, method) if point.tolerance == tolerance), None)


def _times(
    bar: str,
    points: Sequence[Point],
    rival: Point | None,
    limit: float,
    goal: float,
    error: float = math.inf,
    *,
    judge: bool = True,
) -> Row:
    """How much faster the best propagator is at the rival's error, or at `error` if that is smaller."""
    words = f"{bar} (goal {goal:g})"
    if rival is None:
        return not_measured(words, f">= {limit:g}", ABSENT)
    method, mine = _own_time(points, min(error, rival.error))
    words = f"{words}: {method} {mine:.3g} ms, it {rival.ms:.3g} ms at {rival.error:.1g}"
    ratio = rival.ms / mine
    return at_least(words, ratio, limit) if judge else reported(words, ratio)
