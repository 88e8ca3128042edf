"""Suite `integrators`: error against run time of every propagator and of the peers, honesty of estimates, bars.

Times are processor times of all threads, warm, medians of five rounds in which the rivals take turns; whoever takes
longer than a few seconds is timed once, and whoever takes longer than twenty in the run that gives the answer. Bars:
times faster than peers at equal or smaller error, on points of one run. With a folder: a picture.

Peers are general integrators, each by its fastest face. Every right-hand side is compiled by Numba (heyoka's from
formulas); Jacobians are given to whoever takes them. None of these libraries is needed to use the package; they are the
extra `peers`.
"""

from __future__ import annotations

import importlib.util
import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.benchmarks.pictures import draw_integrators
from pipeline.benchmarks.problems import AS_EXACT_AS_CAN_BE, OWN, Answer, Problem, raced
from pipeline.benchmarks.references import Reference, equations, reference
from pipeline.benchmarks.tables import RATIO, Row, at_least, not_measured, progress, reported, rounds, timed
from synth.phase import Floats
from synth.systems.dispatch import derivative, jacobian

Call = Callable[[], Floats]  # one integration from start to end: states (k, n)
ABSOLUTE = 1e-3  # absolute tolerance over the relative one: angles are of 0.01 to 1 rad
ABSENT = "not installed, or did not reach it: extra 'peers'"
ANY, WANTED = math.nan, 1e-6
_STIFF = ((1e-6, 1.5), (1e-9, 3.0), (1e-12, 6.0))
BARS: tuple[tuple[str, str, float, float, float | None], ...] = (
    ("linear", "heyoka", ANY, 1e-14, 80.0),
    ("linear", "scipy DOP853", ANY, 1e-14, 5000.0),
    ("linear", "CyRK DOP853", 1e-9, 1e-14, 400.0),
    ("nonlinear", "heyoka", 1e-12, 1e-11, 18.0),
    ("nonlinear", "CyRK DOP853", 1e-9, 1e-11, 90.0),
    ("nonlinear", "scipy DOP853", ANY, 1e-11, None),
    ("short beam", "heyoka", 1e-9, math.inf, 1.2),
    ("short beam", "heyoka", 1e-11, math.inf, 1.3),
    ("beam", "heyoka", 1e-9, math.inf, 2.0),
    ("beam", "heyoka", 1e-11, math.inf, 2.0),
    ("beam", "scipy DOP853", 1e-9, math.inf, None),
    ("van der Pol", "scipy Radau", 1e-9, math.inf, None),
    *((name, peer, tolerance, math.inf, limit) for name in ("van der Pol", "stiff beam")
      for peer in ("CyRK RADAU", "CVODE BDF") for tolerance, limit in _STIFF),
)  # fmt: skip
"""Problem, peer, its tolerance (`ANY`: its fastest point that errs by 1e-6 at most), the largest error of ours, and how
many times faster ours must be at that error and not above the peer's; None is reported only."""
UNDER = 10.0  # the true error may be so many times the estimate
OVER = 1000.0  # the estimate may be so many times the true error
EXACT = 1e-15  # An estimate of a few roundings is not asked to be met from below: an error may vanish by chance
TOLERANCES = (1e-6, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14)
STIFF_TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15)
PEER_TOLERANCES = (1e-6, 1e-9, 1e-11, 1e-12, 1e-13, 1e-15)
QUICK_TOLERANCES = (1e-6, 1e-9, 1e-12)
REPEATS = 5
ONCE, QUICK_ONCE = 5.0, 0.25  # s: whoever takes longer is timed once
LONG = 20.0  # s: whoever takes longer is not called again to be timed: what it compiled is within 5 % of that


class Peer(NamedTuple):
    """A way to call a library: its name to import, and (problem, tolerance) -> call, compiling done.

    `stiff`: sensible for stiff problems alone, for others alone, or for both (None).
    """

    library: str
    make: Callable[[Problem, float], Call]
    stiff: bool | None


def heyoka(problem: Problem, tolerance: float) -> Call:
    """Adaptive Taylor integration, non-compact mode, in double."""
    import heyoka as hy

    start, times = problem.start, problem.times
    integrator = hy.taylor_adaptive(equations(problem, float), start, tol=tolerance, compact_mode=False)

    def call() -> Floats:
        integrator.time = times[0]
        integrator.state[:] = start
        outcome, *_, states = integrator.propagate_grid(times)
        if outcome != hy.taylor_outcome.time_limit:
            raise RefusedError(f"heyoka: {outcome}")
        return np.asarray(states)

    return call


def cyrk(problem: Problem, tolerance: float, method: str) -> Call:
    """CyRK called from compiled code with a C callback: its fastest face."""
    from CyRK import cyjit, nbsolve2_ivp
    from numba import carray  # type: ignore[attr-defined]  # its stubs forget it

    system, size = problem.system, problem.start.size

    def slopes(out: Any, time: float, state: Any, parameters: Any) -> None:
        derivative(time, carray(state, size), system, carray(out, size))

    compiled = cyjit(slopes)
    start, times = problem.start, problem.times
    span, tolerances = (float(times[0]), float(times[-1])), {"rtol": tolerance, "atol": ABSOLUTE * tolerance}

    def call() -> Floats:
        assert compiled.address  # keeps the callback alive
        found = nbsolve2_ivp(compiled.address, span, start, method, times, **tolerances)
        good, states = bool(found.success), np.array(found.y).T.copy()
        found.free()
        if not good or states.shape[0] != times.size:
            raise RefusedError(f"CyRK {method}: it says that it did not succeed")
        return states

    return call


def _compiled(problem: Problem) -> tuple[Any, Any]:
    """Right-hand side and Jacobian, which fill (time, state, out), with the problem's constants compiled in."""
    from numba import njit

    system, size = problem.system, problem.start.size

    def slopes(time: float, state: Floats, out: Floats) -> None:
        derivative(time, state, system, out)

    def matrix(time: float, state: Floats, out: Floats) -> None:
        jacobian(time, state.copy(), system, out, np.empty(size), np.empty(size))

    return njit(slopes), njit(matrix)


def _returning(fill: Any, shape: tuple[int, ...]) -> Any:
    """The same as (time, state) -> out."""
    from numba import njit

    def call(time: float, state: Floats) -> Floats:
        out = np.empty(shape)
        fill(time, state, out)
        return out

    return njit(call)


def scipy(problem: Problem, tolerance: float, method: str) -> Call:
    """scipy's `solve_ivp`."""
    from scipy.integrate import solve_ivp

    integrate: Any = solve_ivp  # whose stubs want to know the method beforehand
    size, (slopes, matrix) = problem.start.size, _compiled(problem)
    right = _returning(slopes, (size,))
    options: dict[str, Any] = {"rtol": max(tolerance, 1e-13), "atol": ABSOLUTE * tolerance}
    if problem.stiff:
        options["jac"] = _returning(matrix, (size, size))
    span = (float(problem.times[0]), float(problem.times[-1]))

    def call() -> Floats:
        found: Any = integrate(right, span, problem.start, method, problem.times, **options)
        if not found.success:
            raise RefusedError(f"scipy {method}: {found.message}")
        return np.asarray(found.y).T

    return call


def cvode(problem: Problem, tolerance: float, method: str) -> Call:
    """SUNDIALS CVODE by scikit-sundae, which counts the arguments of what it calls: no compiled function shows them."""
    from sksundae.cvode import CVODE

    slopes, matrix = _compiled(problem)
    options: dict[str, Any] = {"rtol": tolerance, "atol": ABSOLUTE * tolerance, "max_num_steps": 10_000_000}
    if problem.stiff:
        options["jacfn"] = lambda time, state, rates, out: matrix(time, state, out)
    solver = CVODE(lambda time, state, out: slopes(time, state, out), method=method, **options)

    def call() -> Floats:
        found = solver.solve(problem.times, problem.start)
        states = np.asarray(found.y)
        if found.success and problem.times.size == 2:
            return states[[0, -1]]  # two instants mean every step to it
        if not found.success or len(found.t) != problem.times.size:
            raise RefusedError(f"CVODE {method}: {found.message}")
        return states

    return call


PEERS: Mapping[str, Peer] = {
    "heyoka": Peer("heyoka", heyoka, None),
    "CyRK DOP853": Peer("CyRK", partial(cyrk, method="DOP853"), False),
    "CyRK RADAU": Peer("CyRK", partial(cyrk, method="RADAU"), True),
    "scipy DOP853": Peer("scipy", partial(scipy, method="DOP853"), False),
    "scipy Radau": Peer("scipy", partial(scipy, method="Radau"), True),
    "CVODE Adams": Peer("sksundae", partial(cvode, method="Adams"), False),
    "CVODE BDF": Peer("sksundae", partial(cvode, method="BDF"), True),
}  # All of them, by the names under which rows and pictures show them


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield three kinds of rows: work-precision, honesty, bars. Quick: a tenth as long, fewer tolerances."""
    races: dict[str, tuple[str, list[Point]]] = {}
    for name, problem in raced(quick=quick).items():
        truth = reference(problem)
        races[name] = truth.source, sweep(problem, truth, quick=quick)
        yield from (point.row(truth.source) for point in races[name][1])
    points = {name: found for name, (_, found) in races.items()}
    for found in points.values():
        yield from estimates(found)
    for bar in judged(points):
        # of short problems, on which starting up is what takes the time: reported, not judged
        yield bar | {"limit": f"of the full run: {bar['limit']}", "pass": None} if quick else bar
    if folder is not None and importlib.util.find_spec("matplotlib") is not None:
        draw_integrators(races, folder / "integrators.png")


@dataclass(frozen=True)
class Point:
    """One method, the project's own or a peer, at one tolerance (NaN where none can be asked for) on one problem."""

    problem: str
    method: str
    own: bool
    tolerance: float
    error: float = math.nan  # of the angles, relative to the largest; NaN where refused
    whole_error: float = math.nan  # of all components of the state
    estimate: float = math.nan  # the propagator's own; NaN for peers
    seconds: tuple[float, ...] = ()  # processor time of each run
    note: str = ""  # why there is no value

    @property
    def ms(self) -> float:
        """Median time, ms; NaN where there was none."""
        return 1e3 * statistics.median(self.seconds) if self.seconds else math.nan

    def row(self, reference: str) -> Row:
        """As the suite yields it."""
        named = {"problem": self.problem, "method": self.method, "tolerance": self.tolerance}
        errors = {"error": self.error, "estimate": self.estimate, "ms": self.ms}
        least, most = (1e3 * end(self.seconds, default=math.nan) for end in (min, max))
        return {**named, **errors, "ms_least": least, "ms_most": most, "reference": reference, "note": self.note}


def contenders(problem: Problem) -> tuple[str, ...]:
    """Names of all propagators, and of the peers that are sensible for the problem."""
    return (*OWN, *(name for name, peer in PEERS.items() if peer.stiff in (None, problem.stiff)))


def set_up(problem: Problem, method: str, tolerance: float) -> Callable[[], Answer]:
    """A call of a propagator or a peer, by name; `RefusedError` for no such problem, `ImportError` if not installed."""
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
            error, whole = (truth.error(problem, answer, of) for of in (problem.judged, range(problem.start.size)))
            point = replace(point, error=error, whole_error=whole, estimate=answer.estimated_error, seconds=(took,))
            if took > (QUICK_ONCE if quick else ONCE):
                points.append(point)
            else:
                runners[f"{method} {tolerance}"] = point, call
    taken = rounds({name: call for name, (_, call) in runners.items()}, REPEATS)
    points += [replace(point, seconds=tuple(taken[name])) for name, (point, _) in runners.items()]
    return sorted(points, key=lambda point: (names.index(point.method), -point.tolerance))


def honest(error: float, estimate: float) -> bool:
    """Whether an estimate fits the true error; NaN fits nothing."""
    return error <= UNDER * estimate and (error >= estimate / OVER or estimate <= EXACT)


def estimates(points: Sequence[Point]) -> Iterator[Row]:
    """One row for each point at which one of the project's propagators gave a value."""
    for point in points:
        if point.own and point.seconds and not math.isnan(point.estimate):
            error, estimate = point.whole_error, point.estimate
            named = {"honesty": point.problem, "method": point.method, "tolerance": point.tolerance}
            sizes = {"error": error, "estimate": estimate, "error_over_estimate": error / estimate}
            yield {**named, **sizes, "pass": honest(error, estimate)}


def judged(found: Mapping[str, Sequence[Point]]) -> Iterator[Row]:
    """Bars from the points of the suite."""
    for name, peer, tolerance, error, limit in BARS:
        any_of, points = math.isnan(tolerance), [point for point in found[name] if point.error >= 0.0]
        rivals = [point for point in points if point.method == peer and (any_of or point.tolerance == tolerance)]
        rival = fastest(rivals, WANTED if any_of else math.inf)
        at = f"{WANTED:g} of error" if any_of else f"{tolerance:g}"
        bar = f"{name}{'' if math.isinf(error) else f' at <= {error:g}'}: times faster than {peer} at {at}"
        if rival is None:
            yield not_measured(bar, "reported" if limit is None else f">= {limit:g}", ABSENT)
            continue
        own = fastest([point for point in points if point.own], min(error, rival.error))
        ratio, unit = math.nan, f"none of ours; it {rival.ms:.3g} ms at {rival.error:.1g}"
        if own is not None:
            every = [theirs / ours for ours, theirs in zip(own.seconds, rival.seconds, strict=False)]  # of one round
            unit = f"{RATIO}, {min(every):.3g} to {max(every):.3g}: {own.method} {own.ms:.3g} ms, it {rival.ms:.3g} ms"
            ratio = rival.ms / own.ms
        yield reported(bar, ratio, unit) if limit is None else at_least(bar, ratio, limit, unit)


def fastest(points: Sequence[Point], error: float) -> Point | None:
    """The fastest of some points that have no larger error."""
    return min((point for point in points if point.error <= error), key=lambda point: point.ms, default=None)
