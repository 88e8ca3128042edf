"""Lock map of system (2) over tau and chi, and basins of the full system, by motion alone; rows are kept."""

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
"""Rows and columns of either map."""
SWINGS = 2000
TAUS = (-0.06, 0.06)
MOST_CHI = 1.3 * COUPLING / 0.02
"""Of the map: beyond the tip of the tongue."""
BASIN = Clocks(0.02, 0.01, 1.2e-4, (0.028, 0.028), 0.2)
"""A full system in which the paper's regime and quadrature both attract."""
BASIN_SWINGS = 3000
_TOLERANCE = 1e-7
_SECTIONS = 201
_STILL = 0.3  # rad: psi of locked clocks in the last part moves less


def lock_map(size: int, kept: Kept) -> tuple[Floats, Floats, list[Row]]:
    """Chi across, tau up, and a row for each tau: whether each pair locked, and CPU time.

    Clocks begin a tenth of a radian off quadrature and swing 2,000 times. Locked is who has not slipped in the last
    third: slips that take longer than all of it are not seen, which widens the narrow ends of the tongue.
    """
    taus, chis = np.linspace(*TAUS, size), np.linspace(0.0, MOST_CHI, size + 1)[1:]
    rows = []
    for tau in progress(taus.tolist(), "lock map", size):
        pair = Clocks(0.02, 0.02, COUPLING, (tau, tau))
        configuration = {"map": "lock", "clocks": pair, "chi": chis.tolist(), "swings": SWINGS}
        found = kept.get(configuration)
        if found is None:
            started = time.process_time()
            starts = np.tile([0.0, 0.0, 2.0, 0.0, 0.2, 1.98], (size, 1))
            psi = _differences([pair.detuned(chi).small() for chi in chis.tolist()], starts, SWINGS)
            locked = np.ptp(psi[:, 2 * _SECTIONS // 3 :], axis=1) < _STILL
            found = [{"tau": tau, "locked": locked.astype(int).tolist(), "cpu_s": time.process_time() - started}]
            kept.put(configuration, found)
        rows += found
    return chis, taus, rows


def measured_edge(chis: Floats, row: Row) -> float:
    """Middle between the last chi that locked and the first that did not, counted from 0."""
    locked = np.asarray(row["locked"], dtype=bool)
    slipped = np.flatnonzero(~locked)
    if slipped.size == 0:
        return math.inf
    width = float(chis[1] - chis[0])
    return (float(slipped[0]) + 0.5) * width


def theory_edge(tau: float) -> float:
    """Leading order."""
    return edge(Clocks(0.02, 0.02, COUPLING, (tau, tau)))


def balance_edge(tau: float) -> float:
    """Of the slow flow."""
    return edge_of_balance(Clocks(0.02, 0.02, COUPLING, (tau, tau)))


def basins(size: int, kept: Kept) -> tuple[Floats, Floats, list[Row]]:
    """First phase difference across, first swing of the second clock up, and what they end in, a row a swing.

    0 in phase, 1 antiphase, 2 quadrature, 3 none of these. Clocks differ by a millionth, the beam begins at rest.
    """
    phases, sizes = np.linspace(-math.pi, math.pi, size, endpoint=False), np.linspace(0.2, 3.0, size)
    pair = BASIN.detuned(1e-8)
    rows = []
    for swing in progress(sizes.tolist(), "basins", size):
        configuration = {
            "map": "basin",
            "clocks": pair,
            "phase": phases.tolist(),
            "size": swing,
            "swings": BASIN_SWINGS,
        }
        found = kept.get(configuration)
        if found is None:
            starts = np.zeros((size, 6))
            starts[:, 2] = 2.0 * BASIN.swing
            starts[:, 4] = swing * BASIN.swing * np.cos(phases)
            starts[:, 5] = swing * BASIN.swing * np.sin(phases)
            psi = _differences([pair.full()] * size, starts, BASIN_SWINGS)
            found = [{"size": swing, "ends": [_end(course) for course in psi]}]
            kept.put(configuration, found)
        rows += found
    return phases, sizes, rows


def _differences(systems: list[Any], starts: Floats, swings: int) -> Floats:
    """(members, sections) unwrapped phase of the first clock less that of the second."""
    times = np.linspace(0.0, 2.0 * math.pi * swings, _SECTIONS)
    states = integrate_ensemble(systems, starts, times, tolerance=_TOLERANCE)
    turned = np.arctan2(-states[:, :, 3::2], states[:, :, 2::2])
    return np.asarray(np.unwrap(turned[:, :, 0] - turned[:, :, 1], axis=1))


def _end(psi: Floats) -> int:
    late = psi[5 * _SECTIONS // 6 :]
    angle = abs(math.remainder(float(late.mean()), 2.0 * math.pi))
    if float(np.ptp(late)) > _STILL:
        return 3
    places = (0.0, math.pi, 0.5 * math.pi)
    return next((k for k, place in enumerate(places) if abs(angle - place) < _STILL), 3)
