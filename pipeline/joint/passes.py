"""What a pass over the lattice takes and leaves behind."""

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import Flow


class Readings(NamedTuple):
    """What was read, sorted by the lattice's nodes; k nodes, r readings, t traces, p pendulums."""

    first: np.ndarray  # (k + 1,) first reading of each node
    trace: np.ndarray  # (r,) below t: a trace; t: the horizontal acceleration, t + 1: the vertical one
    offset: Floats  # (r,) time after the node, s, of either sign
    value: Floats  # (r,) rad, or acceleration over reference gravity
    variance: Floats  # (r,) of the reading; infinite = left out
    combination: Floats  # (t, p)
    others: Floats  # (r,) rad, what cross-talk adds, as it was read; or empty
    pace: Floats  # (r,) of its delay, over that of its trace; or empty


class Columns(NamedTuple):
    """The constants; c of them."""

    kind: np.ndarray
    member: np.ndarray  # (c,) kind of `kinds`; pendulum, trace (-1: all) or state that it belongs to
    centre: Floats
    width: Floats
    """(c,) s: of GRAVITY a cubic spline's, width 0: the whole record; of DRIFT centre and scale; of STEP, CLOCK and
    KNOCK their time (the width: so much later); of DRY the centre is the speed below which it fades, rad s-1."""
    value: Floats  # (c,)
    forced: np.ndarray
    of_traces: np.ndarray  # Places of those that move the pendulums, and of those that are in the readings


class Task(NamedTuple):
    """What a pass takes; d states."""

    flow: Flow
    readings: Readings
    columns: Columns
    known: Floats
    recorded: Floats
    slope: Floats
    """(k, 4) at the nodes of each step: Z that acts beside the states; recorded heave; its derivative with time. Each
    may be empty where nothing asks for it."""
    about: Floats  # (k, d) path about which the flow is linearised; empty: the prediction itself
    breaks: np.ndarray  # (b, 2) nodes, in order, at which a pendulum is where nothing before tells, and that pendulum
    gate: float  # Readings whose error is larger than so many deviations are left out; 0: none
    plain: bool  # Whether all steps are alike: linear pendulums under constant gravity
    settled: Floats  # (d, d) covariance that linear pendulums come to after a long time; empty: it is not sought


class Pass(NamedTuple):
    """What a sweep works on and leaves behind."""

    state: Floats  # (d, c + 1) derivatives by the constants, then the state; predicted for the first node, then next
    covariance: Floats  # (d, d)
    normal: Floats  # (c + 1, c + 1) sum of products of whitened prediction errors and their derivatives
    totals: Floats  # (3,) sum of the logarithms of the deviations; readings used; readings over the gate
    errors: Floats
    """(r,) prediction errors in their own standard deviations; NaN where there is none; empty without a gate."""
    whitened: Floats
    scale: Floats  # (r,) the same, independent of each other, and their deviations; NaN where the reading was left out


class Kept(NamedTuple):
    """What the smoother needs of a stretch of s nodes and its readings; empty arrays: nothing is kept."""

    swing: Floats  # (s or 1, 2 p, d) derivative's rows of the step that begins at the node; one where all are alike
    push: Floats
    """(s, f + 1 + drives, 2 p) what that step adds to the pendulums: derivatives by the constants that move them, what
    is left, and by what noise does; see `remainder.Steps.push`."""
    first: np.ndarray  # (s,) the node's first row of the next two
    row: Floats
    gain: Floats
    """(r, d) whitened rows of readings in the state, and what they move it by; nodes share them if the gain is kept."""
    errors: Floats  # (r, c + 1) derivatives of the whitened prediction errors, and these; NaN where left out


class Slots(NamedTuple):
    """The readings of a node in their order; u of them at most, kept while the next node's are alike."""

    reading: np.ndarray
    trace: np.ndarray  # (u,) reading; its trace
    offset: Floats
    variance: Floats
    deviation: Floats  # (u,) standard deviation of the prediction error, by itself
    row: Floats
    rate: Floats  # (u, d) row of the reading in the state, and its slope in time
    level: Floats
    heave: Floats
    """(u, d) the row under the linear flow alone; what the ship's vertical motion does between the node and the reading
    to a pendulum that it accelerates by as much."""
    beside: Floats  # (u,) what the row has of the path that it is about beside `level`
    pull: Floats  # (u, 2, 4) factors of the remaining accelerations at the step's nodes in an angle when it is read
