"""Vertical acceleration modulates gravity: the swing's mean frequency falls (Browne)."""

from __future__ import annotations

from pipeline.ledger.entry import Case, Change
from pipeline.ledger.horizontal_acceleration import why_not

NAME = "vertical_acceleration"
FORMULA = "<z''^2>/(4g) / (1 - m^2/4n^2), m the circular frequency of the heave"
SOURCE = "Browne 1937, Mon. Not. R. astr. Soc. Geophys. Suppl. 4, 271; fast heave: Milne's equation to second order"
NEEDS: tuple[str, ...] = ()
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """From the recorded heave."""
    after = case.gravity_of(case.estimate.frequency)
    shares = case.shares
    if not shares.reduced:
        return Change(after, 0.0, why_not(case), applied=False)
    if case.prepared.observation.vertical is not None:
        return Change(after, 0.0, "record/vertical_acceleration")
    return Change(after, 0.0, "no record/vertical_acceleration in the record", applied=False)
