"""Suite `huygens`: the paper's regime by four ways, what locks, and what holds of the paper.

With a folder: Fig. 2 redrawn, the lock map, and its finished rows, from which an interrupted run goes on.
"""

import math
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.tables import Row, kept, progress
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, VERMILION, draws, legend, panel, save, sheet
from synth.huygens.balance import Regime, solutions
from synth.huygens.clocks import Clocks
from synth.huygens.locking import edge, edge_of_balance, orbit_slope, slope, stability
from synth.huygens.orbit import orbit
from synth.huygens.paper import COUPLING, DAMPING, corrected, printed
from synth.integrators.collocation import integrate_ensemble

LABELS = {"beta": "beta", "q": "q = 2X/l", "tau": "tau", "k": "k = d eta/d chi"}
"""Of a regime: detuning of the frequency, amplitude of the beam, detuning of the clocks, slope d eta/d chi."""
DRIVE = 0.02  # delta, of which the paper gives none
EDGE = 0.08  # asked of the leading order's edge, relative; the map's own step comes on top
FULL, QUICK = 64, 12  # Rows and columns of the map
SWINGS = 2000
TAUS = (-0.06, 0.06)
MOST_CHI = 1.3 * COUPLING / 0.02  # of the map: beyond the tip of the tongue
_TOLERANCE = 1e-7
_SECTIONS = 201
_STILL = 0.3  # rad: psi of locked clocks in the last part moves less
ALPHAS = (-0.175, -0.25, -0.35, -0.5, -0.65, -0.25 * math.pi, -0.9, -1.0, -1.1, -1.25, -1.396)

_WAYS: dict[str, dict[str, Any]] = {
    "paper": {"color": GREY, "linestyle": "--", "linewidth": 2.4},
    "corrected chain": {"color": VERMILION, "linewidth": 2.2, "alpha": 0.6},
    "balance": {"color": BLUE, "linestyle": "", "marker": "s", "markersize": 9, "fillstyle": "none"},
    "orbit": {"color": GREEN, "linestyle": "", "marker": "o", "markersize": 5.5},
}


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield the regime a way and alpha, the edge of locking a tau, and what holds; quick: three alphas, a small map."""
    curves = rows(ALPHAS[2::4] if quick else ALPHAS)
    yield from curves
    size = QUICK if quick else FULL
    chis, taus, locked = lock_map(size, folder)
    borders = edges(chis, taus, locked)
    yield from borders
    yield from claims(curves, borders, float(chis[1] - chis[0]))
    if folder is not None and draws():
        smooth = [row for alpha in np.linspace(min(ALPHAS), max(ALPHAS), 200) for row in closed(alpha)]
        marks = [row for row in curves if row["way"] not in {line["way"] for line in smooth}]
        draw_regime([*smooth, *marks], folder / "huygens-figure-2.png")
        draw_locking(chis, taus, locked, borders, folder / "huygens-map.png")


def rows(alphas: Sequence[float]) -> list[Row]:
    """One row an alpha and way. Balance and orbit are of the clocks that the corrected chain finds."""
    table = []
    for alpha in alphas:
        chain = corrected(alpha, DRIVE)  # whose delta0 and delta the clocks have, counted in its own frequency
        stretch, tau = math.sqrt(1.0 + float(chain.beta)), float(chain.tau)
        clocks = Clocks(DAMPING / stretch, DRIVE / stretch, COUPLING, (tau, tau))
        regime = nearest(clocks, alpha)
        found, k = orbit(regime, clocks), (slope(regime, clocks, shifts=True), orbit_slope(regime, clocks))
        table += closed(alpha)
        for way, each, gradient in zip(("balance", "orbit"), (regime, found.regime), k, strict=True):
            middle = 0.5 * sum(each.alpha)
            table.append(_row(way, middle, each.beta, each.q, clocks.mean_detuning, gradient))
        table[-1]["stable"] = found.stable
    return table


def closed(alpha: float) -> list[Row]:
    """Rows of the ways that are formulas: the paper's and the corrected chain."""
    ways = {"paper": printed(alpha), "corrected chain": corrected(alpha, DRIVE)}
    return [_row(way, alpha, chain.beta, chain.q, chain.tau, chain.slope) for way, chain in ways.items()]


def _row(way: str, alpha: float, *values: Any) -> Row:
    return {"way": way, "alpha": alpha, **dict(zip(LABELS, map(float, values), strict=True)), "stable": None}


def nearest(clocks: Clocks, alpha: float) -> Regime:
    """The fixed point of the slow flow that is in phase, at this alpha."""
    return min(solutions(clocks, shifts=True), key=lambda each: abs(each.alpha[0] - alpha) + abs(each.offset))


def claims(curves: Sequence[Row], edges: Sequence[Row], step: float) -> list[Row]:
    """One row a claim, from the suite's rows and the step of chi on the lock map."""
    by_way = {way: [row for row in curves if row["way"] == way] for way in {row["way"] for row in curves}}
    orbit = by_way["orbit"]
    beta = _apart(orbit, by_way["corrected chain"], "beta")
    slope = _apart(orbit, by_way["balance"], "k", relative=True)
    plain = _apart(by_way["paper"], orbit, "k", relative=True)
    share = float(np.mean([row["stable"] is False for row in orbit]))
    pairs = [(row["edge_by_motion"], row["edge_by_theory"]) for row in edges if abs(row["tau"]) < 0.03]
    edge = max(max(0.0, abs(moved / theory - 1.0) - step / theory) for moved, theory in pairs)
    pair = _pair(-0.0114)
    quadrature = next(each for each in solutions(pair, shifts=True) if each.q == 0.0)
    growth = stability(quadrature, pair).growth  # per z, of the slowest perturbation
    rows: list[tuple[str, float, float | None, bool | None]] = [
        ("beta(alpha) of (14) is that of the true orbit", beta, 2e-4, beta < 2e-4),
        ("k of the orbit is that of the six equations", slope, 1e-3, slope < 1e-3),
        ("k as printed, without 1/(2 delta), is not: it errs by", plain, None, None),
        ("the paper's regime is unstable in its system (2): share of alphas", share, 1.0, share == 1.0),
        ("the edge of locking is that of theory, for |tau| < 0.03", edge, EDGE, edge <= EDGE),
        ("quadrature attracts in system (2)", growth, 0.0, growth < 0.0),
    ]
    return [dict(zip(("claim", "value", "limit", "pass"), row, strict=True)) for row in rows]


def _apart(rows: Sequence[Row], others: Sequence[Row], key: str, relative: bool = False) -> float:
    pairs = [(float(one[key]), float(other[key])) for one, other in zip(rows, others, strict=True)]
    return max(abs(one / other - 1.0) if relative else abs(one - other) for one, other in pairs)


def lock_map(size: int, folder: Path | None) -> tuple[Floats, Floats, list[Row]]:
    """Chi across, tau up, and a row for each tau: whether each pair locked, and CPU time. Clocks begin a tenth of a
    radian off quadrature; locked is who has not slipped in the last third of 2,000 swings: slower slips are not seen,
    which widens the narrow ends of the tongue."""
    taus, chis = np.linspace(*TAUS, size), np.linspace(0.0, MOST_CHI, size + 1)[1:]
    rows = []
    for tau in progress(taus.tolist(), "lock map"):
        configuration = {"map": "lock", "clocks": _pair(tau), "chi": chis.tolist(), "swings": SWINGS}
        rows += kept(folder, configuration, partial(_map_row, tau, chis))
    return chis, taus, rows


def _map_row(tau: float, chis: Floats) -> list[Row]:
    started = time.process_time()
    times = np.linspace(0.0, 2.0 * math.pi * SWINGS, _SECTIONS)
    starts = np.tile([0.0, 0.0, 2.0, 0.0, 0.2, 1.98], (chis.size, 1))
    systems = [_pair(tau).detuned(chi).small() for chi in chis.tolist()]
    states = integrate_ensemble(systems, starts, times, tolerance=_TOLERANCE)
    turned = np.arctan2(-states[:, :, 3::2], states[:, :, 2::2])
    psi = np.unwrap(turned[:, :, 0] - turned[:, :, 1], axis=1)
    locked = np.ptp(psi[:, 2 * _SECTIONS // 3 :], axis=1) < _STILL
    return [{"tau": tau, "locked": locked.astype(int).tolist(), "cpu_s": time.process_time() - started}]


def _pair(tau: float) -> Clocks:
    return Clocks(0.02, 0.02, COUPLING, (tau, tau))


def edges(chis: Floats, taus: Floats, rows: list[Row]) -> list[Row]:
    """Edge of locking at each tau: by motion, by theory (leading order) and of the slow flow."""
    return [
        {
            "tau": tau,
            "edge_by_motion": measured_edge(chis, row),
            "edge_by_theory": edge(_pair(tau)),
            "edge_by_balance": edge_of_balance(_pair(tau)),
            "ms_a_member": 1e3 * float(row["cpu_s"]) / chis.size,
        }
        for tau, row in zip(taus.tolist(), rows, strict=True)
    ]


def measured_edge(chis: Floats, row: Row) -> float:
    """Middle between the last chi that locked and the first that did not, counted from 0."""
    locked = list(row["locked"])
    return (locked.index(0) + 0.5) * float(chis[1] - chis[0]) if 0 in locked else math.inf


def draw_regime(rows: Sequence[Row], path: Path) -> None:
    """Draw beta (the paper's Fig. 2), q, tau and k over alpha; a line or a mark for each way."""
    words = "delta0 = 0.02, nu = 5.714e-5 as in their Fig. 2 (top left); delta = 0.02; system (2), where it is a saddle"
    figure = sheet("The synchronous regime of Kanunnikov and Lamper, by four ways", words, 11.5, 8.4)
    grid = figure.add_gridspec(2, 2)
    for number, (key, label) in enumerate(LABELS.items()):
        axes = panel(figure, grid[number // 2, number % 2], f"{key}(alpha)", "alpha, rad", label)
        for way, look in _WAYS.items():
            points = sorted((row["alpha"], row[key]) for row in rows if row["way"] == way)
            axes.plot(*np.array(points).T, label=way, **look)
        legend(axes)
    save(figure, path)


def draw_locking(chis: Floats, taus: Floats, rows: Sequence[Row], edges: Sequence[Row], path: Path) -> None:
    """Draw where clocks lock over tau and chi, with theory's edge and the slow flow's."""
    from matplotlib.colors import ListedColormap

    words = "system (2), 2,000 swings a cell from near quadrature; slower slips count as locked"
    figure = sheet("What locks (blue) and what slips", words, 7.4, 6.2)
    axes = panel(figure, figure.add_gridspec(1, 1)[0], "", "tau", "chi")
    axes.grid(visible=False)
    locked = np.array([row["locked"] for row in rows], dtype=float).T
    axes.pcolormesh(taus, chis, locked, cmap=ListedColormap(["#f1f1f1", BLUE]), shading="nearest", vmin=0.0, vmax=1.0)
    lines = {"by theory, leading order": ("edge_by_theory", ORANGE), "of the slow flow": ("edge_by_balance", "black")}
    for source, (key, color) in lines.items():
        axes.plot(taus, [row[key] for row in edges], color=color, linewidth=1.8, label=f"edge {source}")
    axes.set_ylim(0.0, float(chis[-1]))
    legend(axes, loc="upper left")
    save(figure, path)
