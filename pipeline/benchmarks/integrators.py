"""Suite `integrators`: error against run time of every propagator and of the peers, and bars.

Times are processor times of all threads, warm, medians of five rounds in which the rivals take turns. Bars: times
faster than peers at equal or smaller error, on points of one run. Peers (the extra `peers`) are general integrators,
each by its fastest face: compiled right-hand sides, Jacobians for whoever takes them. With a folder: a picture.
"""

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.benchmarks.problems import CLOSED, OWN, PICARD, Answer, Call, Make, Problem, raced
from pipeline.benchmarks.references import Reference, reference, taylor
from pipeline.benchmarks.tables import RATIO, Row, at_least, not_measured, progress, rounds, timed
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, draws, legend, panel, save, sheet
from synth.phase import Floats
from synth.systems.dispatch import derivative, jacobian

ABSOLUTE = 1e-3  # absolute tolerance over the relative one: angles are of 0.01 to 1 rad
NOT_INSTALLED = "not installed: extra 'peers'"
ABSENT = "not installed, or did not reach it: extra 'peers'"
ANY, WANTED = math.nan, 1e-6
_STIFF = ((1e-6, 1.5), (1e-9, 3.0), (1e-12, 6.0))
BARS: tuple[tuple[str, str, float, float, float], ...] = (
    ("linear", "heyoka", ANY, 1e-14, 80.0),
    ("linear", "scipy DOP853", ANY, 1e-14, 5000.0),
    ("linear", "CyRK DOP853", 1e-9, 1e-14, 400.0),
    ("nonlinear", "heyoka", 1e-12, 1e-11, 18.0),
    ("nonlinear", "CyRK DOP853", 1e-9, 1e-11, 90.0),
    ("short beam", "heyoka", 1e-9, math.inf, 1.2),
    ("short beam", "heyoka", 1e-11, math.inf, 1.3),
    ("beam", "heyoka", 1e-9, math.inf, 2.0),
    ("beam", "heyoka", 1e-11, math.inf, 2.0),
    *((name, peer, tolerance, math.inf, limit) for name in ("van der Pol", "stiff beam")
      for peer in ("CyRK RADAU", "CVODE BDF") for tolerance, limit in _STIFF),
)  # fmt: skip
"""Problem, peer, its tolerance (`ANY`: its fastest point that errs by 1e-6 at most), the largest error of ours, and how
many times faster ours must be at that error and not above the peer's."""
TOLERANCES = (1e-6, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14)
STIFF_TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15)
PEER_TOLERANCES = (1e-6, 1e-9, 1e-11, 1e-12, 1e-13, 1e-15)
QUICK_TOLERANCES = (1e-6, 1e-9, 1e-12)
REPEATS = 5
ONCE, QUICK_ONCE = 5.0, 0.25  # s: whoever takes longer is timed once
LONG = 20.0  # s: whoever takes longer is not called again to be timed: what it compiled is within 5 % of that


def heyoka(problem: Problem, tolerance: float) -> Call:
    """Adaptive Taylor integration, non-compact mode, in double."""
    states = taylor(problem, problem.times, tolerance, float, compact_mode=False)
    return lambda: (problem.angles(states()), math.nan)


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

    def call() -> Answer:
        assert compiled.address  # keeps the callback alive
        found = nbsolve2_ivp(compiled.address, span, start, method, times, **tolerances)
        good, states = bool(found.success), np.array(found.y).T.copy()
        found.free()
        if not good or states.shape[0] != times.size:
            raise RefusedError(f"CyRK {method}: it says that it did not succeed")
        return problem.angles(states), math.nan

    return call


def scipy(problem: Problem, tolerance: float) -> Call:
    """scipy's `solve_ivp` by DOP853, with the problem's constants compiled into the right-hand side."""
    from numba import njit
    from scipy.integrate import solve_ivp

    integrate: Any = solve_ivp  # whose stubs want more than compiled functions show
    system, size, times = problem.system, problem.start.size, problem.times

    def slopes(time: float, state: Floats) -> Floats:
        out = np.empty(size)
        derivative(time, state, system, out)
        return out

    right, span = njit(slopes), (float(times[0]), float(times[-1]))
    tolerances = {"rtol": max(tolerance, 1e-13), "atol": ABSOLUTE * tolerance}

    def call() -> Answer:
        found: Any = integrate(right, span, problem.start, "DOP853", times, **tolerances)
        if not found.success:
            raise RefusedError(f"scipy DOP853: {found.message}")
        return problem.angles(found.y.T), math.nan

    return call


def cvode(problem: Problem, tolerance: float) -> Call:
    """SUNDIALS CVODE, its stiff method with the Jacobian; it counts arguments, which no compiled function shows."""
    from numba import njit
    from sksundae.cvode import CVODE

    system, size, times = problem.system, problem.start.size, problem.times

    def slopes(time: float, state: Floats, out: Floats) -> None:
        derivative(time, state, system, out)

    def matrix(time: float, state: Floats, out: Floats) -> None:
        jacobian(time, state.copy(), system, out, np.empty(size), np.empty(size))

    compiled: tuple[Any, Any] = njit(slopes), njit(matrix)
    fill, fill_matrix = compiled
    options: dict[str, Any] = {"rtol": tolerance, "atol": ABSOLUTE * tolerance, "max_num_steps": 10_000_000}
    options["jacfn"] = lambda time, state, rates, out: fill_matrix(time, state, out)
    solver = CVODE(lambda time, state, out: fill(time, state, out), method="BDF", **options)

    def call() -> Answer:
        found = solver.solve(times, problem.start)
        if not found.success:
            raise RefusedError(f"CVODE BDF: {found.message}")
        return problem.angles(found.y[[0, -1]] if times.size == 2 else found.y), math.nan  # two mean every step to it

    return call


PEERS: Mapping[str, tuple[Make, bool | None]] = {
    "heyoka": (heyoka, None),
    "CyRK DOP853": (partial(cyrk, method="DOP853"), False),
    "CyRK RADAU": (partial(cyrk, method="RADAU"), True),
    "scipy DOP853": (scipy, False),
    "CVODE BDF": (cvode, True),
}
"""All of them, by the names under which rows and pictures show them: (problem, tolerance) -> call, compiling done; and
whether sensible for stiff problems alone, for others alone, or for both (None)."""
LOOKS: Mapping[str, tuple[str, str]] = {
    **{name: (colour, "o") for name, colour in zip(OWN, (BLUE, GREEN, ORANGE, VERMILION, PURPLE), strict=True)},
    "heyoka": ("#000000", "D"), "CyRK DOP853": (GREY, "s"), "CyRK RADAU": (GREY, "s"),
    "scipy DOP853": ("#8c8c8c", "^"), "CVODE BDF": ("#b0b0b0", "X"),
}  # fmt: skip
"""Method -> colour and mark; the project's are coloured, peers grey."""
_MEASURED = ("error", "estimate", "ms", "ms_least", "ms_most")
_LEAST_ERROR = 1e-17


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield work-precision with the propagators' own estimates, and bars; quick: a tenth as long, fewer tolerances."""
    races: dict[str, list[Row]] = {}
    for name, problem in raced(quick=quick).items():
        races[name] = sweep(problem, reference(problem), quick=quick)
        yield from races[name]
    for bar in judged(races):
        # of short problems, on which starting up is what takes the time: reported, not judged
        yield bar | {"limit": f"of the full run: {bar['limit']}", "pass": None} if quick else bar
    if folder is not None and draws():
        draw(races, folder / "integrators.png")


def contenders(problem: Problem) -> tuple[str, ...]:
    """Names of all propagators, and of the peers that are sensible for the problem."""
    return (*OWN, *(name for name, (_, stiff) in PEERS.items() if stiff in (None, problem.stiff)))


def set_up(problem: Problem, method: str, tolerance: float) -> Call:
    """A call of a propagator or a peer, by name; `RefusedError` for no such problem, `ImportError` if not installed."""
    return (OWN[method] if method in OWN else PEERS[method][0])(problem, tolerance)


def tolerances(problem: Problem, method: str, *, quick: bool) -> Sequence[float]:
    """What to ask a method for, loosest first."""
    if method in (CLOSED, PICARD):
        return (math.nan,)
    if method in OWN and problem.stiff:
        return STIFF_TOLERANCES  # a few ms each
    if quick:
        return QUICK_TOLERANCES
    return PEER_TOLERANCES if method in PEERS else TOLERANCES


def sweep(problem: Problem, truth: Reference, *, quick: bool, names: Sequence[str] | None = None) -> list[Row]:
    """A row a contender, all by default, and tolerance (NaN where none can be asked for): error of the angles relative
    to the largest, the propagator's own estimate of it (NaN for peers), processor time, or why there is no value: who
    declines is not asked for more."""
    rows: list[Row] = []
    runners: dict[str, Call] = {}
    for method in progress(contenders(problem) if names is None else names, problem.name):
        for tolerance in tolerances(problem, method, quick=quick):
            row: Row = {"problem": problem.name, "method": method, "tolerance": tolerance}
            row |= dict.fromkeys(_MEASURED, math.nan) | {"reference": truth.source, "note": ""}
            rows.append(row)
            try:
                call = set_up(problem, method, tolerance)
                (angles, estimate), took = timed(call)
                if took <= LONG:
                    took = timed(call)[1]
            except (ImportError, RefusedError) as why:
                row["note"] = NOT_INSTALLED if isinstance(why, ImportError) else f"refused: {why}"
                break
            row |= {"error": truth.error(angles), "estimate": estimate} | _times([took])
            if took <= (QUICK_ONCE if quick else ONCE):
                runners[str(len(rows) - 1)] = call
    for place, taken in rounds(runners, REPEATS).items():
        rows[int(place)] |= _times(taken)
    return rows


def _times(seconds: Sequence[float]) -> Row:
    ms = (1e3 * each(seconds) for each in (statistics.median, min, max))
    return dict(zip(_MEASURED[2:], ms, strict=True))


def judged(races: Mapping[str, Sequence[Row]]) -> Iterator[Row]:
    """Bars from the rows of the suite."""
    for name, peer, tolerance, error, limit in BARS:
        any_of, rows = math.isnan(tolerance), races[name]
        rivals = [row for row in rows if row["method"] == peer and (any_of or row["tolerance"] == tolerance)]
        rival = fastest(rivals, WANTED if any_of else math.inf)
        at = f"{WANTED:g} of error" if any_of else f"{tolerance:g}"
        bar = f"{name}{'' if math.isinf(error) else f' at <= {error:g}'}: times faster than {peer} at {at}"
        if rival is None:
            yield not_measured(bar, f">= {limit:g}", ABSENT)
            continue
        own = fastest([row for row in rows if row["method"] in OWN], min(error, rival["error"]))
        ratio, unit = math.nan, f"none of ours; it {rival['ms']:.3g} ms at {rival['error']:.1g}"
        if own is not None:
            ratio = rival["ms"] / own["ms"]
            least, most = rival["ms_least"] / own["ms_most"], rival["ms_most"] / own["ms_least"]
            told = f"{own['method']} {own['ms']:.3g} ms, it {rival['ms']:.3g} ms"
            unit = f"{RATIO}, {least:.3g} to {most:.3g}: {told}"
        yield at_least(bar, ratio, limit, unit)


def fastest(rows: Sequence[Row], error: float) -> Row | None:
    """The fastest of some that have no larger error."""
    return min((row for row in rows if row["error"] <= error), key=lambda row: row["ms"], default=None)


def draw(races: Mapping[str, Sequence[Row]], path: Path) -> None:
    """Draw the rows of every problem; the project's own are larger and in front."""
    words = "largest error over the largest size, against the truth above each panel; warm processor time, medians"
    figure = sheet("Error against time", words, 16.5, 8.4)
    grid = figure.add_gridspec(2, 4)
    key = figure.add_subplot(grid[1, 3])
    key.set_axis_off()
    every = [row for rows in races.values() for row in rows]
    for number, (name, rows) in enumerate(races.items()):
        place = grid[number // 4, number % 4]
        axes = panel(figure, place, f"{name}\n", "processor time, ms", "error", xscale="log", yscale="log")
        axes.text(0.0, 1.015, f"against {rows[0]['reference']}", transform=axes.transAxes, fontsize=8, color=GREY)
    for method, (colour, mark) in LOOKS.items():
        own = method in OWN
        look: Any = {"color": colour, "marker": mark, "markersize": 5.5 if own else 4.0, "linewidth": 1.0 + own}
        rows = [row for row in every if row["method"] == method]
        absent = any(row["note"] == NOT_INSTALLED for row in rows)
        if absent or any(row["ms"] > 0.0 for row in rows):
            key.plot([], [], label=f"{method}, not installed" if absent else method, **look)
        for axes, name in zip(figure.axes[1:], races, strict=True):
            line = [(row["ms"], max(row["error"], _LEAST_ERROR)) for row in rows if row["problem"] == name]
            axes.plot(*np.array(line or [(math.nan, math.nan)]).T, **look, zorder=2 + own)
    legend(key, loc="center left", title="method")
    save(figure, path)
