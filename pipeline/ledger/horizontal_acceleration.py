"""Horizontal acceleration in the plane of swing strengthens the apparent gravity (Browne)."""

from __future__ import annotations

from pipeline.ledger.entry import MGAL, Case, Change

NAME = "horizontal_acceleration"
FORMULA = "-<x''^2>/(2g) in the slow limit; n sqrt(Gamma) with Gamma = 1/cos psi + tan psi psi''/n^2"
SOURCE = "Browne 1937, Mon. Not. R. astr. Soc. Geophys. Suppl. 4, 271"
NEEDS: tuple[str, ...] = ()
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """From the slow motion of the first pendulum, which shows the support's acceleration itself."""
    after = case.gravity_of(case.estimate.frequency - case.shares.vertical)
    if case.shares.reduced:
        return Change(after, 0.0, "slow motion of the first pendulum")
    size = -0.5 * gravity * case.prepared.slow_square / MGAL  # x'' = -g psi
    real = "" if case.prepared.observation.restoring == "linear" else f"; real ones would need about {size:+.2f} mGal"
    return Change(after, 0.0, why_not(case) + real, applied=False)


def why_not(case: Case) -> str:
    """Why a method leaves accelerations alone."""
    if case.prepared.observation.restoring == "linear":
        return "the record says restoring = linear: linear pendulums do not feel it"
    return "the method takes the pendulums as linear"
