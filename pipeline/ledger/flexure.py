"""A support that sways under the pendulums lengthens the period of each; their difference does not feel it.

The sway is a horizontal acceleration common to both, `x'' = -n^2 sum m_j g theta_j / K`, and enters the equation of the
difference as any other: multiplied by n1-n2, where the method removes it. The formula of a single pendulum must
therefore not be subtracted from the difference; it is told for comparison.
"""

from __future__ import annotations

import numpy as np

from pipeline.ledger.entry import MGAL, Case, Change

NAME = "flexure"
FORMULA = "one pendulum: T_rigid = T (1 - e), e = (m g/(2 K l)) (1 + (A2/A1) cos(Phi2-Phi1)); the difference: 0"
SOURCE = (
    "Peirce 1883, Report of the U.S. Coast and Geodetic Survey for 1881, App. 14; Panteleev 1958, (2), the sway as x''"
)
NEEDS = ("support_stiffness", "mass", "length")
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Nothing is left to add; the reason names what either pendulum alone would need."""
    one, two = (2.0 * gravity * part / MGAL for part in single(case, gravity))
    seen = case.prepared.observation
    alone = f"pendulum {seen.first} alone {one:+.2f} mGal, pendulum {seen.second} {two:+.2f}"
    return Change(gravity, 0.0, f"the difference sheds all sway of the support; {alone}")


def single(case: Case, gravity: float) -> tuple[float, float]:
    """Relative lengthening e of either pendulum's period alone, mean over the record."""
    mass, length, stiffness = case.pair("mass"), case.pair("length"), case.scalar("support_stiffness")
    envelope = case.prepared.sliding
    first, second = envelope.first, envelope.first - envelope.difference
    present = np.isfinite(first) & np.isfinite(second)
    # both pull at once: m_i theta_i + m_j theta_j, its part in phase with theta_i
    cross = float(np.mean((first * second.conj())[present].real))
    squares = [float(np.mean(np.abs(own[present]) ** 2)) for own in (first, second)]
    pull = [mass[i] * squares[i] + mass[1 - i] * cross for i in (0, 1)]
    one, two = (gravity * pull[i] / (2.0 * stiffness * length[i] * squares[i]) for i in (0, 1))
    return float(one), float(two)
