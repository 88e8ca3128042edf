"""gamma1 - gamma2 of pendulums whose damping is not stated: told from the record, held by what is likely.

The difference is driven by `2 (gamma1 - gamma2) theta1'` beside all else, one more column in the least squares of the
identity. Pendulums of one frame and air decay alike: before the record speaks their difference is nought, with a sigma
of a quarter of gamma2, which the fit gives. Where the record tells more it decides; where it tells less (a beat far
longer than the record) the doubt goes into gravity's sigma.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.sensors.departures import DAMPING
from pipeline.sensors.state import State, fit, unexplained

DECAY = 3e-6  # s-1; of pendulums that hardly decay the difference is nothing
LIKELY = 0.25  # of gamma2, 1 sigma of the difference before the record speaks
ROUNDS = 6
SLOPES = 0.2, 1.5  # what the column finds of a change of the difference, at least and at most
SETTLED = 0.1  # sigma, of the last round's change


def with_damping_told(state: State) -> tuple[State, float]:
    """The record with the difference of damping that it tells, and 1 sigma of n2, rad s-1, from what it does not tell.

    Parameters
    ----------
    state : State
        A record, and the identity fitted to it.

    Raises
    ------
    RefusedError
        No identity fits.
    """
    given, prepared = state, state.prepared
    if prepared.known_damping is not None:
        return given, 0.0
    held, slope = prepared.observation.damping_apart, 1.0
    before: tuple[float, float] | None = None
    for _ in range(ROUNDS):
        likely = LIKELY * state.fitted.damping_rate
        if likely < LIKELY * DECAY:
            return given, 0.0
        found = fit(prepared, state.fitted, [DAMPING])
        value, by_unit = float(found.value[0]), abs(float(found.by_unit[0]))
        if before is not None and held != before[0]:
            # the nonlinear identity is begun from gamma2 of the linear one, which takes up a part
            slope = float(np.clip((before[1] - value) / (held - before[0]), *SLOPES))
        before = held, value
        variance = (float(found.sigma[0]) / slope) ** 2
        trust = likely**2 / (likely**2 + variance)
        held, known = trust * (held + value / slope), float(np.sqrt(trust * variance))
        prepared = replace(prepared, observation=replace(prepared.observation, damping_apart=held))
        state = State.of(prepared, state.real)
        if abs(held - before[0]) < SETTLED * known:
            break
    if unexplained(state):
        return given, by_unit * likely  # something else is the matter as well, and may be all of what was told
    return state, by_unit * known
