"""Suite `huygens`: the paper's regime by every way there is, what locks, and what holds of the paper.

With a folder: tables (CSV), everything (JSON), pictures (PNG) of Fig. 2 redrawn and of the lock map, and the finished
rows of the map, so that a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks import huygens_curves, json_table
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.huygens_curves import claims
from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.progress import progress
from synth.huygens.clocks import Clocks
from synth.huygens.locking import edge, edge_of_balance
from synth.huygens.paper import COUPLING
from synth.integrators.collocation_ensemble import integrate_ensemble

FULL, QUICK = 64, 12
"""Rows and columns of the map."""
SWINGS = 2000
TAUS = (-0.06, 0.06)
MOST_CHI = 1.3 * COUPLING / 0.02
"""Of the map: beyond the tip of the tongue."""
_TOLERANCE = 1e-7
_SECTIONS = 201
_STILL = 0.3  # rad: psi of locked clocks in the last part moves less
Row = dict[str, Any]
ALPHAS = (-0.175, -0.25, -0.35, -0.5, -0.65, -0.25 * math.pi, -0.9, -1.0, -1.1, -1.25, -1.396)


def lock_map(size: int, kept: Kept) -> tuple[Floats, Floats, list[Row]]:
    """Chi across, tau up, and a row for each tau: whether each pair locked, and CPU time.

    Clocks begin a tenth of a radian off quadrature and swing 2,000 times. Locked is who has not slipped in the last
    third: slips that take longer than all of it are not seen, which widens the narrow ends of the tongue.
    """
    taus, chis = np.linspace(*TAUS, size), np.linspace(0.0, MOST_CHI, size + 1)[1:]
    times = np.linspace(0.0, 2.0 * math.pi * SWINGS, _SECTIONS)
    rows = []
    for tau in progress(taus.tolist(), "lock map", size):
        pair = Clocks(0.02, 0.02, COUPLING, (tau, tau))
        configuration = {"map": "lock", "clocks": pair, "chi": chis.tolist(), "swings": SWINGS}
        found = kept.get(configuration)
        if found is None:
            started = time.process_time()
            starts = np.tile([0.0, 0.0, 2.0, 0.0, 0.2, 1.98], (size, 1))
            systems = [pair.detuned(chi).small() for chi in chis.tolist()]
            states = integrate_ensemble(systems, starts, times, tolerance=_TOLERANCE)
            turned = np.arctan2(-states[:, :, 3::2], states[:, :, 2::2])
            psi = np.unwrap(turned[:, :, 0] - turned[:, :, 1], axis=1)
            locked = np.ptp(psi[:, 2 * _SECTIONS // 3 :], axis=1) < _STILL
            found = [{"tau": tau, "locked": locked.astype(int).tolist(), "cpu_s": time.process_time() - started}]
            kept.put(configuration, found)
        rows += found
    return chis, taus, rows


def edges(chis: Floats, taus: Floats, rows: list[Row]) -> list[Row]:
    """Edge of locking at each tau: by motion, by theory (leading order) and of the slow flow."""
    table = []
    for tau, row in zip(taus.tolist(), rows, strict=True):
        pair = Clocks(0.02, 0.02, COUPLING, (tau, tau))
        table.append(
            {
                "tau": tau,
                "edge_by_motion": measured_edge(chis, row),
                "edge_by_theory": edge(pair),
                "edge_by_balance": edge_of_balance(pair),
                "ms_a_member": 1e3 * float(row["cpu_s"]) / chis.size,
            }
        )
    return table


def measured_edge(chis: Floats, row: Row) -> float:
    """Middle between the last chi that locked and the first that did not, counted from 0."""
    slipped = np.flatnonzero(~np.asarray(row["locked"], dtype=bool))
    if slipped.size == 0:
        return math.inf
    return (float(slipped[0]) + 0.5) * float(chis[1] - chis[0])


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield beta, q, tau and k a way and alpha, the edge of locking a tau, and in words what holds.

    Quick: three alphas, a map of 12 x 12 instead of 64 x 64.
    """
    curves = huygens_curves.rows(ALPHAS[2::4] if quick else ALPHAS)
    yield from curves
    size = QUICK if quick else FULL
    chis, taus, locked = lock_map(size, Kept(folder))
    borders = edges(chis, taus, locked)
    yield from borders[:: max(1, size // 12)]
    held = claims(curves, borders, float(chis[1] - chis[0]))
    yield from held
    if folder is not None:
        tables = {"curves": curves, "edges": borders, "claims": held}
        for name, table in tables.items():
            write(folder / f"huygens-{name}.csv", table)
        json_table.write(folder / "huygens.json", {"quick": quick, **tables})
        if importlib.util.find_spec("matplotlib") is not None:
            from pipeline.benchmarks.pictures import draw_locking, draw_regime

            smooth = [
                row for alpha in np.linspace(min(ALPHAS), max(ALPHAS), 200) for row in huygens_curves.closed(alpha)
            ]
            marks = [row for row in curves if row["way"] not in {line["way"] for line in smooth}]
            draw_regime([*smooth, *marks], folder / "huygens-figure-2.png")
            draw_locking(chis, taus, locked, borders, folder / "huygens-map.png")
