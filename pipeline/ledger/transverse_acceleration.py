"""Horizontal acceleration across the plane of swing, where a gimbal lets the plane follow the apparent vertical."""

from __future__ import annotations

from pipeline.ledger.entry import MGAL, Case, Change

NAME = "transverse_acceleration"
FORMULA = "-<y''^2>/(2g), where the plane of swing follows the apparent vertical"
SOURCE = "Browne 1937, Mon. Not. R. astr. Soc. Geophys. Suppl. 4, 271"
NEEDS = ("transverse_acceleration_mean_square",)
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Take away what the apparent vertical is stronger by; no trace shows it, so it must be stated."""
    square = case.scalar(NEEDS[0])
    after = gravity - square / (2.0 * gravity)
    own = case.uncertainty(NEEDS[0])
    sigma = case.sigma(square=None if own is None else own / (2.0 * gravity) / MGAL)
    return Change(after, sigma, f"rms {square**0.5:.4f} m/s2")
