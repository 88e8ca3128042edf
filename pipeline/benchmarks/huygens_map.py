"""Lock map of system (2) over tau and chi, by motion alone; rows are kept."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.progress import progress
from synth.huygens.clocks import Clocks
from synth.huygens.locking import edge, edge_of_balance
from synth.huygens.paper import COUPLING
from synth.integrators.collocation_ensemble import integrate_ensemble

Row = dict[str, Any]
FULL, QUICK = 64, 12
"""Rows and columns of the map."""
SWINGS = 2000
TAUS = (-0.06, 0.06)
MOST_CHI = 1.3 * COUPLING / 0.02
"""Of the map: beyond the tip of the tongue."""
_TOLERANCE = 1e-7
_SECTIONS = 201
_STILL = 0.3  # rad: psi of locked clocks in the last part moves less


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
