"""Tide of the yielding Earth."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from pipeline.conditions import Constants
from pipeline.ledger.entry import MGAL, Case, Change, correction
from synth.kernels.tide import tide

NEEDS = ("latitude", "longitude")
LOADING, LEAST, PLACES = 0.1, 1e-3, 64  # of the tide, by the sea's own load; mGal; moments of a record


@correction(
    "tide",
    "1.16 G M r/d^3 (3 cos^2 Z - 1) and the next order, of Moon and Sun",
    "Longman 1959, J. Geophys. Res. 64, 2351; places of Moon and Sun: Meeus 1998",
    NEEDS,
    uses=("height",),
)
def moon_and_sun(case: Case, gravity: float) -> Change:
    """Add the mean of what it took off over the record."""
    seen = case.prepared.observation
    if "epoch" not in seen.constants:
        return Change(gravity, 0.0, "units of time name no date", applied=False)
    time: Floats = seen.start + float(seen.time[-1]) * np.linspace(0.0, 1.0, PLACES)
    lost = float(np.mean(tidal_loss(seen.constants, time)))
    sigma = LOADING * abs(lost) / MGAL + LEAST
    return Change(gravity + lost, sigma, "sigma: a tenth of it for the load of the sea's own tide")


def tidal_loss(constants: Constants, time: Floats) -> Floats:
    """What the tide takes off gravity at times of the record, m s-2."""
    latitude, longitude, height = (float(constants.get(name, 0.0)) for name in (*NEEDS, "height"))
    return tide(np.asarray(float(constants["epoch"]) + time), latitude, longitude, height)
