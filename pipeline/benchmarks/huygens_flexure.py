"""Two gravimeter pendulums on one support that yields: how much slower they are, by motion and by formula.

Sideways (Peirce 1883): `e = (m g/(2 K l)) sum_j (A_j/A_i) cos(Phi_j - Phi_i)`, j over both pendulums. Up and down the
support is pulled twice a swing, by `m l (phi phi')' = -m g A^2 cos 2nt`; its x'' modulates the gravity that pendulums
feel, which gives `e = (m g/(K l)) sum_j A_j^2 cos 2(Phi_j - Phi_i)`: of second order in the arc. K is the stiffness
less what the inertia of everything carried takes from it at the frequency of the pull.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from synth.integrators.explicit import integrate
from synth.phase import Floats
from synth.systems.driven_pendulums import plain
from synth.systems.elastic_beam import ElasticBeam
from synth.systems.flexible_frame import FlexibleFrame

Row = dict[str, Any]
GRAVITY = 9.81
LENGTH = 0.2534  # m: of half a second
MASS = 1.0  # kg, each
SUPPORT = 20.0  # kg
STIFFNESS = 2e5  # N/m: swings of the support are some 16 times as fast as the pendulums
ARC = 0.005  # rad
VERTICAL_ARC = 0.1  # rad: of second order, it would be lost at a gravimeter's arc
_SWINGS = 60
_A_SWING = 32
_TOLERANCE = 1e-14
_MGAL = 1e5  # a m/s^2


def rows() -> Iterator[Row]:
    """One row a support and phase: e by formula and by motion, and what it is in gravity."""
    for support in ("sideways", "up and down"):
        for said, phase in (("in step", 0.0), ("quadrature", 0.5 * math.pi), ("antiphase", math.pi)):
            formula = expected(support, phase)
            # in quadrature a pull out of phase makes one pendulum grow and the other shrink: short runs
            motion = moved(support, phase, _SWINGS // 10 if said == "quadrature" else _SWINGS)
            yield {
                "support": support,
                "pendulums": said,
                "arc_rad": ARC if support == "sideways" else VERTICAL_ARC,
                "e_by_formula": formula,
                "e_by_motion": motion,
                "gravity_mgal": 2.0 * motion * GRAVITY * _MGAL,
            }


def expected(support: str, phase: float) -> float:
    """Relative lengthening of the first pendulum's period; both of equal mass, length and arc."""
    n_squared = GRAVITY / LENGTH
    carried = SUPPORT + 2.0 * MASS
    if support == "sideways":
        stiffness = STIFFNESS - carried * n_squared
        return MASS * GRAVITY / (2.0 * stiffness * LENGTH) * (1.0 + math.cos(phase))
    stiffness = STIFFNESS - carried * 4.0 * n_squared
    return MASS * GRAVITY * VERTICAL_ARC**2 / (stiffness * LENGTH) * (1.0 + math.cos(2.0 * phase))


def moved(support: str, phase: float, swings: int) -> float:
    """The same by motion: the first pendulum's frequency on a rigid support over that on this one, less 1."""
    n = math.sqrt(GRAVITY / LENGTH)
    arc = ARC if support == "sideways" else VERTICAL_ARC
    own = [arc, 0.0, arc * math.cos(phase), -arc * n * math.sin(phase)]
    masses, lengths = np.full(2, MASS), np.full(2, LENGTH)
    if support == "sideways":
        system: Any = FlexibleFrame(SUPPORT, masses, lengths, STIFFNESS, gravity=GRAVITY)
        rest = [MASS * GRAVITY * (own[0] + own[2]) / STIFFNESS, MASS * GRAVITY * (own[1] + own[3]) / STIFFNESS]
    else:
        system = ElasticBeam(SUPPORT, masses, lengths, STIFFNESS, gravity=GRAVITY)
        rest = [-MASS * GRAVITY * arc**2 * (1.0 + math.cos(2.0 * phase)) / STIFFNESS, 0.0]
    times = np.linspace(0.0, 2.0 * math.pi * swings / n, swings * _A_SWING + 1)
    yielding = integrate(system, [*rest, *own], times, tolerance=_TOLERANCE).states[:, 2:4]
    rigid = integrate(plain(n), own[:2], times, tolerance=_TOLERANCE).states
    return _frequency(rigid, times, n) / _frequency(yielding, times, n) - 1.0


def _frequency(states: Floats, times: Floats, n: float) -> float:
    """Mean rate of the phase, by a straight line through it, its ends weighted down."""
    phase = np.unwrap(np.angle(states[:, 0] - 1j * states[:, 1] / n))
    return float(np.polyfit(times, phase, 1, w=np.hanning(times.size + 2)[1:-1])[0])
