"""What a pass over the lattice takes and leaves behind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats


class Readings(NamedTuple):
    """What was read, sorted by the lattice's nodes; k nodes, r readings, t traces, p pendulums.

    Attributes
    ----------
    first : (k + 1,) array of int
        First reading of each node.
    trace : (r,) array of int
        Below t: a trace; t: the horizontal acceleration, t + 1: the vertical one.
    offset : (r,) array
        Time after the node, s, of either sign.
    value : (r,) array
        rad, or acceleration over reference gravity.
    variance : (r,) array
        Of the reading; infinite = left out.
    combination : (t, p) array
    """

    first: np.ndarray
    trace: np.ndarray
    offset: Floats
    value: Floats
    variance: Floats
    combination: Floats


class Columns(NamedTuple):
    """The constants; c of them.

    Attributes
    ----------
    kind, member : (c,) arrays of int
        Kind as above; pendulum, trace (-1: all) or state that it belongs to.
    centre, width : (c,) arrays
        s: of GRAVITY a cubic spline's, width 0: the whole record; of DRIFT centre and scale; of STEP, CLOCK and KNOCK
        their time; of DRY the centre is the speed below which it fades, rad s-1.
    value : (c,) array
    """

    kind: np.ndarray
    member: np.ndarray
    centre: Floats
    width: Floats
    value: Floats


class Pass(NamedTuple):
    """What a sweep works on and leaves behind; see `sweep`.

    Attributes
    ----------
    state : (d, c + 1) array
        Derivatives by the constants, last the state itself; predicted for the first node, then for the next.
    covariance : (d, d) array
    normal : (c + 1, c + 1) array
        Sum of products of whitened prediction errors and their derivatives.
    totals : (3,) array
        Sum of the logarithms of the deviations; readings used; readings over the gate.
    errors : (r,) array
        Prediction errors in their own standard deviations; NaN where there is none.
    whitened, scale : (r,) arrays
        The same, independent of each other, and their deviations; NaN where the reading was left out.
    """

    state: Floats
    covariance: Floats
    normal: Floats
    totals: Floats
    errors: Floats
    whitened: Floats
    scale: Floats


class Kept(NamedTuple):
    """What the smoother needs of a stretch of s nodes and its readings; empty arrays: nothing is kept.

    Attributes
    ----------
    swing : (s or 1, 2 p, d) array
        Derivative's rows of the step that begins at the node; one where all are alike.
    push : (s, f + 1 + drives, 2 p) array
        What that step adds to the pendulums: derivatives by the constants that move them, what is left, and by
        what noise does; see `remainder.Steps.push`.
    first : (s,) array of int
        The node's first row of the next two.
    row, gain : (r, d) arrays
        Whitened rows of the readings in the state, and what they move it by; while the gain is kept, nodes share them.
    errors : (r, c + 1) array
        Derivatives of the whitened prediction errors, and these; NaN where left out.
    """

    swing: Floats
    push: Floats
    first: np.ndarray
    row: Floats
    gain: Floats
    errors: Floats


class Slots(NamedTuple):
    """The readings of a node in their order; u of them at most, kept while the next node's are alike.

    Attributes
    ----------
    reading, trace : (u,) arrays of int
        Reading; its trace.
    offset, variance : (u,) arrays
    row, rate : (u, d) arrays
        Row of the reading in the state, and its slope in time.
    level, heave : (u, d) arrays
        The row under the linear flow alone; what the ship's vertical motion does between the node and the reading to a
        pendulum that it accelerates by as much.
    beside : (u,) array
        What the row has of the path that it is about beside `level`.
    pull : (u, 2, 4) array
        Factors of the remaining accelerations at the step's nodes in a pendulum's angle at the reading's time.
    """

    reading: np.ndarray
    trace: np.ndarray
    offset: Floats
    variance: Floats
    row: Floats
    rate: Floats
    level: Floats
    heave: Floats
    beside: Floats
    pull: Floats
