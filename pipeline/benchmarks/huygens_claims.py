"""In words: what holds of the paper, and what does not, each with the number that decides it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from synth.huygens.balance import solutions
from synth.huygens.clocks import Clocks
from synth.huygens.orbit import orbits
from synth.huygens.paper import COUPLING
from synth.huygens.slow_flow import stability

Row = dict[str, Any]
EDGE = 0.08
"""Asked of the leading order's edge, relative; the map's own step comes on top."""


def claims(curves: Sequence[Row], edges: Sequence[Row], step: float) -> list[Row]:
    """One row a claim.

    Parameters
    ----------
    curves, edges : sequences of rows
        Of the suite.
    step : float
        Of chi on the lock map.
    """
    by_way = {way: [row for row in curves if row["way"] == way] for way in {row["way"] for row in curves}}
    orbit, chain, paper, motion = (by_way[way] for way in ("orbit", "corrected chain", "paper", "motion"))
    beta = _apart(orbit, chain, "beta")
    slope = _apart(orbit, by_way["balance"], "k", relative=True)
    plain = _apart(paper, orbit, "k", relative=True)
    moved = _apart(motion, orbit, "beta")
    unstable = [row["stable"] is False for row in orbit]
    near = [row for row in edges if abs(row["tau"]) < 0.03]
    edge = max(
        max(0.0, abs(row["edge_by_motion"] / row["edge_by_theory"] - 1.0) - step / row["edge_by_theory"])
        for row in near
    )
    three = orbits(Clocks(0.002, 0.2, COUPLING, (0.005, 0.005)))
    in_phase = sum(abs(each.regime.offset) < 1e-6 for each in three)
    return [
        _claim("beta(alpha) of (14) is that of the true orbit", beta, 2e-4, beta < 2e-4),
        _claim("so is beta of the motion itself, begun alike", moved, 2e-4, moved < 2e-4),
        _claim("k of the orbit is that of the six equations", slope, 1e-3, slope < 1e-3),
        _claim("k as printed, without 1/(2 delta), is not: it errs by", plain, None, None),
        _claim(
            "the paper's regime is unstable in its system (2): share of alphas",
            float(np.mean(unstable)),
            1.0,
            all(unstable),
        ),
        _claim("the edge of locking is that of theory, for |tau| < 0.03", edge, EDGE, edge <= EDGE),
        _claim("three regimes in phase coexist at delta0 = .002, delta = .2", float(in_phase), 3.0, in_phase == 3),
        _claim("quadrature attracts in system (2)", *_quadrature()),
    ]


def _quadrature() -> tuple[float, float, bool]:
    """Growth per z of the slowest perturbation, and that it is below zero."""
    pair = Clocks(0.02, 0.02, COUPLING, (-0.0114, -0.0114))
    found = next(each for each in solutions(pair, shifts=True) if each.q == 0.0)
    growth = stability(found, pair).growth
    return growth, 0.0, growth < 0.0


def _apart(rows: Sequence[Row], others: Sequence[Row], key: str, relative: bool = False) -> float:
    pairs = [(float(one[key]), float(other[key])) for one, other in zip(rows, others, strict=True)]
    return max(abs(one / other - 1.0) if relative else abs(one - other) for one, other in pairs)


def _claim(said: str, value: float, limit: float | None, holds: bool | None) -> Row:
    return {"claim": said, "value": float(value), "limit": limit, "pass": holds}
