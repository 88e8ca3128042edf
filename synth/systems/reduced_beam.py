"""Clocks on an elastic beam at small arcs: the reduced system (2) of Kanunnikov and Lamper.

    u'' + 2 d0 u' + 4 u = m0 sum (y_i^2)'' ,      y_i'' + (1 + tau_i - u'') y_i = d (1 - y_i^2) y_i'

Time s = w0 t/2, u = x/l, y = S/S0. Solved for u'', the factor `1 - 2 m0 sum y_i^2` appears, that is
`1 - m sum phi_i^2/(M + 2 m)`: printed as it is, the mass matrix is singular where it vanishes and not positive
beyond. There the derivative is NaN, and integrators refuse with `difficulty`.

From a beam in SI units to this system and back (`reduced`):

    s = w0 t/2,  x = l u,  phi_i = S0 y_i/l_i,      w0^2 = K/(M + sum m),  m0 = m S0^2/(2 l^2 (M + sum m)),
    d = 2 eps/w0,  d0 = eps0/w0,  4 g/l_i = w0^2 (1 + tau_i)

It knows one mass, one eps and one S0 = l_i phi0_i, and puts one length l (here the mean) for all of them but in tau_i.
What the clocks differ in by less than their lengths do is of the size of what it neglects anyway.
"""

import math
from typing import NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered
from synth.systems.resistance import VanDerPolDrive
from synth.systems.yielding import ElasticBeam

_ROUNDING = 1e-9


class ReducedBeam(NamedTuple):
    """Parameters; state (u, u', y_1, y_1', y_2, y_2', ...). Mirror: y_i -> -y_i, of each alone."""

    beam_damping: float  # d0 = eps0/w0
    drive: float  # d = 2 eps/w0
    coupling: float  # m0 = m S0^2/(2 l^2 (M + 2 m))
    detuning: Floats  # (pendulums,) tau_i, from 4 w_i^2 = w0^2 (1 + tau_i)
    first_angle: int = 2  # Place of the first clock in the state

    def difficulty(self, state: Floats) -> str | None:
        """Why there is no motion from this state on, or None."""
        left = 1.0 - 2.0 * self.coupling * float((state[2::2] ** 2).sum())
        if left > 1e-3:
            return None
        return "the mass matrix of the reduced beam is singular: m sum phi^2 reaches M + 2 m; use the full system (1), a heavier beam, or a smaller arc"


@registered("derivative", ReducedBeam)
@kernel
def _derivative(time: float, state: Floats, system: ReducedBeam, out: Floats) -> None:
    detuning, drive, coupling = system.detuning, system.drive, 2.0 * system.coupling
    inertia = 1.0
    force = 0.0
    for i in range(detuning.size):
        y, rate = state[2 * i + 2], state[2 * i + 3]
        free = drive * (1.0 - y * y) * rate - (1.0 + detuning[i]) * y  # of y'', as if the beam were held fast
        inertia -= coupling * (y * y)
        force += rate * rate + y * free
        out[2 * i + 2] = rate
        out[2 * i + 3] = free
    force = coupling * force - 2.0 * system.beam_damping * state[1] - 4.0 * state[0]
    beam = force / inertia if inertia > 0.0 else math.nan
    out[0] = state[1]
    out[1] = beam
    for i in range(detuning.size):
        out[2 * i + 3] += beam * state[2 * i + 2]


class Reduction(NamedTuple):
    """System (2), and the units of its time, beam and clocks."""

    system: ReducedBeam
    time_scale: float  # s = time_scale x t, 1/s: w0/2
    displacement_scale: float  # x = displacement_scale x u, m: l
    angle_scale: Floats  # (pendulums,) phi_i = angle_scale_i x y_i, rad: S0/l_i

    @property
    def units(self) -> Floats:
        """(n,) state (x, x', phi_1, phi_1', ...) in m, rad and seconds over that in (u, u', y_1, y_1', ...)."""
        scales = np.concatenate([[self.displacement_scale], self.angle_scale])
        return np.stack([scales, scales * self.time_scale], axis=-1).ravel()


def reduced(beam: ElasticBeam) -> Reduction:
    """Reduce a beam with clocks, whose only term is a `VanDerPolDrive`; `RefusedError` if system (2) cannot hold it."""
    drive = beam.terms
    if not isinstance(drive, VanDerPolDrive):
        raise _refused("each clock needs a van-der-pol escapement and no damping of its own")
    if beam.horizontal is not None or beam.vertical is not None:
        raise _refused("it stands on firm ground, so the scene can have no motion")
    if not np.all(drive.angle > 0.0) or not beam.stiffness > 0.0:
        raise _refused("the angles of the escapements and the stiffness must be above zero")
    arcs = beam.length * drive.angle
    length, arc = float(np.mean(beam.length)), float(np.mean(arcs))
    tolerance = _ROUNDING + float(np.ptp(beam.length)) / length
    for name, values, allowed in (
        ("masses", beam.mass, _ROUNDING),
        ("escapement rates", drive.rate, _ROUNDING),
        ("arcs (length x angle) of the escapements", arcs, tolerance),
    ):
        if np.ptp(values) > allowed * np.max(np.abs(values)):
            raise _refused(f"the {name} must be the same for all clocks")
    total = beam.own_mass + float(np.sum(beam.mass))
    fast = math.sqrt(beam.stiffness / total)  # w0
    system = ReducedBeam(
        beam_damping=beam.damping_rate / fast,
        drive=2.0 * float(drive.rate[0]) / fast,
        coupling=float(beam.mass[0]) * arc**2 / (2.0 * length**2 * total),
        detuning=4.0 * beam.gravity / (beam.length * fast**2) - 1.0,
    )
    return Reduction(system, 0.5 * fast, length, arc / beam.length)


def _refused(what: str) -> RefusedError:
    return RefusedError(f"support: the reduced beam cannot hold these clocks, {what}; choose equations = 'full'")
