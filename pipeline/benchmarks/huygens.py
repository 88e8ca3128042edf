"""Suite `huygens`: the paper's regime by every way there is, what locks, what ends where, work against error,
two gravimeter pendulums on a support that yields, and what holds of the paper.

With a folder: tables (CSV), everything (JSON), pictures (PNG) of Fig. 2 redrawn and of both maps, and the finished rows
of the maps, so that a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks import huygens_curves, huygens_flexure, huygens_map, huygens_work, json_table
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.huygens_claims import claims, flexure_claims
from pipeline.benchmarks.kept import Kept

Row = dict[str, Any]
ALPHAS = (-0.175, -0.25, -0.35, -0.5, -0.65, -0.25 * math.pi, -0.9, -1.0, -1.1, -1.25, -1.396)


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield beta, q, tau and k a way and alpha, the edge of locking a tau, work against error, what a yielding support
    does to gravimeter pendulums, and in words what holds.

    Quick: three alphas, maps of 12 x 12 instead of 64 x 64.
    """
    curves = huygens_curves.rows(ALPHAS[2::4] if quick else ALPHAS)
    yield from curves
    kept, size = Kept(folder), huygens_map.QUICK if quick else huygens_map.FULL
    chis, taus, locked = huygens_map.lock_map(size, kept)
    edges = [_edge(chis, float(tau), row) for tau, row in zip(taus, locked, strict=True)]
    yield from edges[:: max(1, size // 12)]
    phases, sizes, ends = huygens_map.basins(size, kept)
    work = list(huygens_work.rows(quick=quick))
    members = list(huygens_work.member_rows(quick=quick))
    flexure = list(huygens_flexure.rows())
    yield from (*work, *members, *flexure)
    told = [*claims(curves, edges, float(chis[1] - chis[0]), ends), *flexure_claims(flexure)]
    yield from told
    if folder is not None:
        write(folder / "huygens-curves.csv", curves)
        write(folder / "huygens-edges.csv", edges)
        write(folder / "huygens-work.csv", work)
        write(folder / "huygens-members.csv", members)
        write(folder / "huygens-flexure.csv", flexure)
        tables = {"quick": quick, "curves": curves, "edges": edges, "basins": ends, "claims": told}
        tables |= {"work": work, "members": members, "flexure": flexure}
        json_table.write(folder / "huygens.json", tables)
        if importlib.util.find_spec("matplotlib") is not None:
            _draw(folder, curves, (chis, taus, locked), edges, (phases, sizes, ends))


def _edge(chis: Floats, tau: float, row: Row) -> Row:
    return {
        "tau": tau,
        "edge_by_motion": huygens_map.measured_edge(chis, row),
        "edge_by_theory": huygens_map.theory_edge(tau),
        "edge_by_balance": huygens_map.balance_edge(tau),
        "ms_a_member": 1e3 * float(row["cpu_s"]) / chis.size,
    }


def _draw(
    folder: Path,
    curves: list[Row],
    lock: tuple[Floats, Floats, list[Row]],
    edges: list[Row],
    basin: tuple[Floats, Floats, list[Row]],
) -> None:
    from pipeline.benchmarks import huygens_picture

    smooth = [row for alpha in np.linspace(min(ALPHAS), max(ALPHAS), 200) for row in huygens_curves.closed(alpha)]
    marks = [row for row in curves if row["way"] not in {line["way"] for line in smooth}]
    huygens_picture.draw_curves([*smooth, *marks], folder / "huygens-figure-2.png")
    huygens_picture.draw_maps(lock, edges, basin, folder / "huygens-maps.png")
