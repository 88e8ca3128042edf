"""What rounding of the samples to few values does to gravity.

Its errors follow the swing, and hang together while the arcs change by less than a step: they are no noise, though they
pass for it. They are known once the path is: samples of the fitted path, rounded and fitted alike, show the change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.constants import total
from pipeline.joint.explanation import Fitted, again, angles


def change_by_rounding(fit: Fitted, gravity: Floats) -> float:
    """Change of gravity over reference gravity that rounding has made.

    Parameters
    ----------
    fit : Fitted
    gravity : (c,) array
        Row that gives gravity from the constants.
    """
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    own = np.flatnonzero(lattice.trace < problem.traces)
    trace = lattice.trace[own]
    exact = np.einsum("rp,rp->r", lattice.combination[trace], angles(fit, lattice.time[own]))
    exact += total(fit.model.constants, kinds.ZERO, problem.traces + 2)[trace]
    step = problem.steps[trace]
    rounded = np.where(step > 0.0, np.rint(exact / np.maximum(step, 1e-300)) * step, exact)
    found = []
    for readings in (rounded, exact):
        value = lattice.value.copy()
        value[own] = readings
        found.append(again(fit, replace(problem, lattice=replace(lattice, value=value))))
    return float(gravity @ (found[0] - found[1]))
