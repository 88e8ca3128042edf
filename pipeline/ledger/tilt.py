"""A plane of swing out of the vertical feels only a part of gravity."""

from __future__ import annotations

from pipeline.ledger.entry import MGAL, Case, Change

NAME = "tilt"
FORMULA = "g <b^2>/2, b the angle of the plane of swing out of the vertical"
SOURCE = "component of gravity in the plane, g cos b; Vening Meinesz 1929"
NEEDS = ("tilt_mean_square",)
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Divide by the mean cosine, 1 - <b^2>/2."""
    square = case.scalar("tilt_mean_square")
    after = gravity / (1.0 - 0.5 * square)
    own = case.uncertainty(NEEDS[0])
    sigma = case.sigma(square=None if own is None else 0.5 * gravity * own / MGAL)
    return Change(after, sigma, f"rms {1e3 * square**0.5:.3f} mrad")
