"""A plane of swing that rocks pulls the bob outwards."""

from __future__ import annotations

from pipeline.ledger.entry import MGAL, Case, Change

NAME = "rocking"
FORMULA = "-g <b'^2>/n^2, b' the rate at which the plane of swing turns about a horizontal axis"
SOURCE = "centrifugal force in the turning plane, l b'^2 cos theta"
NEEDS = ("rocking_rate_mean_square",)
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Take away the pull, gravity times b'^2/n^2."""
    square = case.scalar(NEEDS[0])
    per_square = gravity / case.estimate.frequency**2
    own = case.uncertainty(NEEDS[0])
    sigma = case.sigma(square=None if own is None else per_square * own / MGAL)
    return Change(gravity - per_square * square, sigma, f"rms {square**0.5:.4f} rad/s")
