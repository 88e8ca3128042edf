"""Suite `huygens`: the paper's regime by every way there is, what locks, and what holds of the paper.

With a folder: tables (CSV), everything (JSON), pictures (PNG) of Fig. 2 redrawn and of the lock map, and the finished
rows of the map, so that a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.benchmarks import huygens_curves, huygens_map, json_table
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.huygens_claims import claims
from pipeline.benchmarks.kept import Kept

Row = dict[str, Any]
ALPHAS = (-0.175, -0.25, -0.35, -0.5, -0.65, -0.25 * math.pi, -0.9, -1.0, -1.1, -1.25, -1.396)


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield beta, q, tau and k a way and alpha, the edge of locking a tau, and in words what holds.

    Quick: three alphas, a map of 12 x 12 instead of 64 x 64.
    """
    curves = huygens_curves.rows(ALPHAS[2::4] if quick else ALPHAS)
    yield from curves
    size = huygens_map.QUICK if quick else huygens_map.FULL
    chis, taus, locked = huygens_map.lock_map(size, Kept(folder))
    edges = huygens_map.edges(chis, taus, locked)
    yield from edges[:: max(1, size // 12)]
    held = claims(curves, edges, float(chis[1] - chis[0]))
    yield from held
    if folder is not None:
        tables = {"curves": curves, "edges": edges, "claims": held}
        for name, table in tables.items():
            write(folder / f"huygens-{name}.csv", table)
        json_table.write(folder / "huygens.json", {"quick": quick, **tables})
        if importlib.util.find_spec("matplotlib") is not None:
            from pipeline.benchmarks import huygens_picture

            smooth = [
                row for alpha in np.linspace(min(ALPHAS), max(ALPHAS), 200) for row in huygens_curves.closed(alpha)
            ]
            marks = [row for row in curves if row["way"] not in {line["way"] for line in smooth}]
            huygens_picture.draw_curves([*smooth, *marks], folder / "huygens-figure-2.png")
            huygens_picture.draw_map(chis, taus, locked, edges, folder / "huygens-map.png")
