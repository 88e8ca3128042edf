"""Coefficients of the Runge-Kutta pair of order 8 of Dormand and Prince, with its dense output of order 7.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed. 1993, section II.10 (code DOP853),
rounded to double, as SciPy has them; the tests check the order conditions that they must meet.

Row s of `WEIGHTS` gives stage s from the slopes before it; rows 13 to 15 are the stages of the dense output.
"""

from __future__ import annotations

from scipy.integrate import DOP853

NODES = (*DOP853.C.tolist(), 1.0, *DOP853.C_EXTRA.tolist())
WEIGHTS = (
    (0.0,),
    *(tuple(row[:stage]) for stage, row in enumerate(DOP853.A.tolist()) if stage),
    tuple(DOP853.B.tolist()),
    *(tuple(row[:stage]) for stage, row in enumerate(DOP853.A_EXTRA.tolist(), start=13)),
)
"""Row 12 holds the weights of the solution itself."""

# fmt: off
CORRECTION = (
    1.9918104693347241e-16, 6.063230360996143e-17, 1.8452543462255e-17, -3.210519761051388e-17,
    -3.401337336317788e-17, 1.2264582770601823e-17, -5.401355163702107e-17, -1.2496437769775465e-17,
    2.8969874090919516e-16, 2.8076857795562253e-16, -3.5844567034839826e-17, -7.619302323506572e-16,
)
# fmt: on
"""Added to row 12: with it the rounded stages meet the conditions of order 1 and 2 to 1e-18, of order 3 to 4e-17.

With the published weights rounded alone they fail by 5e-16, always in the same sense: a false damping that costs 1e-12
in a thousand swings. The smallest correction that mends it, solved in exact arithmetic.
"""

ERRORS = tuple(tuple(row[:12].tolist()) for row in (DOP853.E3, DOP853.E5))
"""Against the embedded solutions of order 3 and of order 5."""

DENSE = tuple(map(tuple, DOP853.D.tolist()))
"""Coefficients 3 to 6 of the dense output from all 16 slopes."""
