"""What acts on gravity unread: the ship in gaps, where its motion is guessed from either side; rounding of readings.

Horizontal motion at x times the swing's frequency stiffens a pendulum by <u^2> (r - r^2 / 2) of gravity, with
r = 1 / (1 - x^2); vertical motion slackens it by <zeta^2> / (4 - x^2). If slow: <u^2> / 2 and <zeta^2> / 4, Browne's
terms; fast horizontal motion slackens it by <u^2> / x^2. The path that is likeliest fades in a gap, or goes on with a
motion that is not the ship's; the mean square outside tells what it is there, but for its scatter. A fit with that as
a known change of gravity shows how much of it gets into the mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.constants import total
from pipeline.joint.explanation import Fitted, again, angles, values

SHORTEST = 2.0  # s: nothing hides in shorter gaps
FORETOLD = 20.0  # s: half of what happens in so long a gap is foretold
NEAR = 0.2  # of a square of frequencies: closer to resonance motion has no steady answer
INDEPENDENT = 10.0  # s, after which a swell's square is another one


def change_in_gaps(fit: Fitted, gravity: Floats) -> tuple[float, float]:
    """Change of mean gravity over reference gravity by motion in gaps, and its 1 sigma; 0 of linear pendulums.

    Parameters
    ----------
    fit : Fitted
    gravity : (c,) array
        Row that gives gravity from the constants.
    """
    problem, lattice, two = fit.model.problem, fit.model.problem.lattice, 2 * fit.model.problem.pendulums
    if not fit.model.assumed.sine or lattice.longest_gap < SHORTEST:
        return 0.0, 0.0
    time, changes, at = lattice.step * np.arange(lattice.nodes), np.zeros((2, lattice.nodes)), two
    for each in fit.model.assumed.ship:
        row, square = each.system()[1], (each.peak / problem.swing) ** 2
        motion = (fit.path[:, at : at + row.size] @ row) ** 2
        at += row.size
        if each.axis == "horizontal":
            answer = (1.0 - square) / ((1.0 - square) ** 2 + NEAR**2)
            changes[0] += (answer - 0.5 * answer**2) * motion
        elif each.axis == "vertical":
            changes[1] -= (4.0 - square) / ((4.0 - square) ** 2 + NEAR**2) * motion
    own = np.unique(lattice.time[lattice.trace < problem.traces])
    after = np.clip(np.searchsorted(own, time), 1, own.size - 1)
    apart = own[after] - own[after - 1]
    inside = apart > SHORTEST
    if not inside.any() or inside.all():
        return 0.0, 0.0
    level, hidden = float(np.abs(changes).sum(axis=0)[~inside].mean()), apart / (apart + FORETOLD) * inside
    if level <= 0.0:
        return 0.0, 0.0
    track = (level * hidden)[:, None] + (problem.track if problem.track.size else np.zeros(1))
    whole = float(gravity @ (again(fit, replace(problem, track=track)) - values(fit)))
    change = changes.sum(axis=0)
    missed = float(change[~inside].mean() - change[inside].mean()) / level
    squares = max(float(inside.sum()) * lattice.step / INDEPENDENT, 1.0)
    return whole * missed, abs(whole) * float(np.sqrt(0.5 / squares))


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
