"""What the unequal periods of the two pendulums do to the phase speed of their difference."""

from __future__ import annotations

import numpy as np

from pipeline.ledger.apparatus import CASE_TILT
from pipeline.ledger.entry import MGAL, Case, Change

NAME = "non_isochronism"
FORMULA = "phi' = n2 + (n1-n2) (Theta1/a) cos(Phi1-phi) - (gamma1-gamma2) (Theta1/a) sin(Phi1-phi)"
SOURCE = "Panteleev 1958, (27), damping added; exact methods: what their fit changes beyond the entries below"
NEEDS: tuple[str, ...] = ()
USES = ("period", "damping_rate")


def uncertainty(case: Case) -> float:
    """From n1/n2, as far as the first period brings it, and from the first trace's gain, arcs and all; mGal.

    What the second period brings is the base tie's; the joint fit holds both.
    """
    period = (
        0.0
        if case.estimate.of_mean
        else case.by_ratio * float(case.prepared.observation.period_relative_uncertainty[0])
    )
    return float(np.hypot(period, case.by_gain_uncertainty))


def change(case: Case, gravity: float) -> Change:
    """All of the method's own correction that is neither arc nor acceleration."""
    estimate, shares = case.estimate, case.shares
    unbent = estimate.frequency - shares.arc - shares.horizontal - shares.vertical
    others = sum(value for name, (value, _, _) in estimate.parts.items() if name != CASE_TILT.NAME)
    after = case.gravity_of(unbent) - others * MGAL
    stated = case.prepared.observation.damping_rate is not None
    applied = unbent != estimate.uncorrected
    told = "damping difference " + ("stated" if stated else "taken as zero, none is stated")
    return Change(
        after,
        uncertainty(case),
        f"n1/n2 from instrument/period; {told}" if applied else "the method corrects nothing",
        applied,
    )
