"""Error against time: every propagator and every peer on one problem, over a sweep of tolerances.

Times are processor times of all threads, warm, medians of five rounds in which the rivals take turns; whoever takes
longer than a few seconds is timed once, and whoever takes longer than twenty in the run that gives the answer.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from data_schemas.errors import RefusedError
from pipeline.benchmarks.clock import rounds, timed
from pipeline.benchmarks.peers import PEERS
from pipeline.benchmarks.problems import AS_EXACT_AS_CAN_BE, OWN, Answer, Problem
from pipeline.benchmarks.references import Reference
from pipeline.benchmarks.tables import Row, progress

TOLERANCES = (1e-6, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14)
STIFF_TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15)
PEER_TOLERANCES = (1e-6, 1e-9, 1e-11, 1e-12, 1e-13, 1e-15)
QUICK_TOLERANCES = (1e-6, 1e-9, 1e-12)
REPEATS = 5
ONCE, QUICK_ONCE = 5.0, 0.25  # s: whoever takes longer is timed once
LONG = 20.0  # s: whoever takes longer is not called again to be timed: what it compiled is within 5 % of that


@dataclass(frozen=True)
class Point:
    """One method, the project's own or a peer, at one tolerance (NaN where none can be asked for) on one problem."""

    problem: str
    method: str
    own: bool
    tolerance: float
    error: float = math.nan
    """Of the angles, relative to the largest; NaN where refused."""
    whole_error: float = math.nan
    """Of all components of the state."""
    estimate: float = math.nan
    """The propagator's own; NaN for peers."""
    seconds: tuple[float, ...] = ()
    """Processor time of each run."""
    note: str = ""
    """Why there is no value."""

    @property
    def ms(self) -> float:
        """Median time, ms; NaN where there was none."""
        return 1e3 * statistics.median(self.seconds) if self.seconds else math.nan

    def row(self, reference: str) -> Row:
        """As the suite yields it."""
        return {
            "problem": self.problem,
            "method": self.method,
            "tolerance": self.tolerance,
            "error": self.error,
            "estimate": self.estimate,
            "ms": self.ms,
            "ms_least": 1e3 * min(self.seconds, default=math.nan),
            "ms_most": 1e3 * max(self.seconds, default=math.nan),
            "reference": reference,
            "note": self.note,
        }


def contenders(problem: Problem) -> tuple[str, ...]:
    """Names of all propagators, and of the peers that are sensible for the problem."""
    return (*OWN, *(name for name, peer in PEERS.items() if peer.stiff in (None, problem.stiff)))


def set_up(problem: Problem, method: str, tolerance: float) -> Callable[[], Answer]:
    """A call of a propagator or a peer, by name.

    `RefusedError` where it does not know this kind of problem, `ImportError` where it is not installed.
    """
    if method in OWN:
        return OWN[method](problem, tolerance)
    call = PEERS[method].make(problem, tolerance)
    return lambda: Answer(call(), math.nan)


def tolerances(problem: Problem, method: str, *, quick: bool) -> Sequence[float]:
    """What to ask a method for, loosest first."""
    if method in AS_EXACT_AS_CAN_BE:
        return (math.nan,)
    if method in OWN and problem.stiff:
        return STIFF_TOLERANCES  # a few ms each
    if quick:
        return QUICK_TOLERANCES
    return PEER_TOLERANCES if method in PEERS else TOLERANCES


def sweep(problem: Problem, truth: Reference, *, quick: bool, names: Sequence[str] | None = None) -> list[Point]:
    """Measure contenders, all by default; one that declines is noted with its reason and not asked for more."""
    points: list[Point] = []
    runners: dict[str, tuple[Point, Callable[[], Answer]]] = {}
    names = contenders(problem) if names is None else names
    for method in progress(names, problem.name, len(names)):
        for tolerance in tolerances(problem, method, quick=quick):
            point = Point(problem.name, method, method in OWN, tolerance)
            try:
                call = set_up(problem, method, tolerance)
                answer, took = timed(call)
                if took <= LONG:
                    took = timed(call)[1]
            except (ImportError, RefusedError) as why:
                absent = isinstance(why, ImportError)
                points.append(replace(point, note="not installed: extra 'peers'" if absent else f"refused: {why}"))
                break
            point = replace(
                point,
                error=truth.error(problem, answer, problem.judged),
                whole_error=truth.error(problem, answer, range(problem.start.size)),
                estimate=answer.estimated_error,
                seconds=(took,),
            )
            if took > (QUICK_ONCE if quick else ONCE):
                points.append(point)
            else:
                runners[f"{method} {tolerance}"] = point, call
    taken = rounds({name: call for name, (_, call) in runners.items()}, REPEATS)
    points += [replace(point, seconds=tuple(taken[name])) for name, (point, _) in runners.items()]
    return sorted(points, key=lambda point: (names.index(point.method), -point.tolerance))
