"""Two clocks on one beam in the few numbers that theory speaks of, and the systems that have exactly these.

Equal clocks with y_1 = +-y_2 and y_1' = +-y_2' stay so exactly, on the paper's regime, a saddle of system (2), which
then looks locked: begin beside it (`perturbed`).
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import UsageError
from synth.phase import Floats
from synth.seeds import generator
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPolDrive
from synth.systems.starts import symmetric
from synth.systems.yielding import ElasticBeam

LIKELY = 1e-6  # Share of the swing by which a start is moved: far above rounding, far below any reading
_STEP = 1e-30


class Clocks(NamedTuple):
    """Kanunnikov and Lamper's system (2), and what the full system (1) has beyond it."""

    beam_damping: float  # d0 = eps0/w0, above 0
    drive: float  # d = 2 eps/w0, above 0
    coupling: float  # nu = 8 mu/l, above 0; in system (2) m0 = mu/l = nu/8
    detuning: tuple[float, float]  # tau_i, from 4 w_i^2 = w0^2 (1 + tau_i)
    swing: float = 0.0  # Phi0 = S0/l, rad: half the swing of the full system; 0 for system (2)

    @property
    def mean_detuning(self) -> float:
        """tau."""
        return 0.5 * (self.detuning[0] + self.detuning[1])

    def detuned(self, difference: float) -> "Clocks":
        """The same clocks about their mean tau, chi = tau_1 - tau_2 apart."""
        mean = self.mean_detuning
        return self._replace(detuning=(mean + 0.5 * difference, mean - 0.5 * difference))

    def small(self) -> ReducedBeam:
        """System (2), its time s = w0 t/2."""
        return ReducedBeam(self.beam_damping, self.drive, self.coupling / 8.0, np.array(self.detuning))

    def full(self) -> ElasticBeam:
        """System (1) in units of its own: s = w0 t/2, mean length and whole mass 1; x is u, phi_i is near Phi0 y_i.

        `UsageError` if the swing is 0, or so small that the clocks would outweigh the whole.
        """
        if not self.swing > 0.0:
            raise UsageError("swing = 0: the full system needs an arc; give Phi0 = S0/l in rad, such as 0.1")
        share = self.coupling / (4.0 * self.swing**2)  # m/(M + 2 m), from m0 = (m/(M + 2 m)) Phi0^2/2
        if not 2.0 * share < 1.0:
            least = math.sqrt(0.5 * self.coupling)
            raise UsageError(f"swing = {self.swing:g}: too small for this coupling; give more than {least:.3g} rad")
        lengths = 1.0 / (1.0 + np.array(self.detuning))
        escapement = VanDerPolDrive(np.full(2, self.drive), self.swing / lengths)
        masses = np.full(2, share)
        return ElasticBeam(1.0 - 2.0 * share, masses, lengths, 4.0, 2.0 * self.beam_damping, 1.0, escapement)


def checked(clocks: Clocks) -> Clocks:
    """The clocks, or UsageError naming what cannot be meant."""
    for name in ("beam_damping", "drive", "coupling"):
        value = getattr(clocks, name)
        if not 0.0 < value < math.inf:
            raise UsageError(f"{name} = {value:g}: theory needs a finite number above 0")
    for value in clocks.detuning:
        if not -1.0 < value < math.inf:
            raise UsageError(f"detuning = {value:g}: 4 w_i^2/w0^2 - 1 lies above -1")
    if not 0.0 <= clocks.swing < math.inf:
        raise UsageError(f"swing = {clocks.swing:g}: give 0 for system (2), or S0/l in rad")
    return clocks


def mirrored(states: Floats) -> Floats:
    """States with both clocks on the other side, y_i -> -y_i; the beam stays."""
    return np.asarray(states * np.array([1.0, 1.0, -1.0, -1.0, -1.0, -1.0]))


def perturbed(system: Any, state: Floats, seed: int, share: float = LIKELY) -> Floats:
    """The state, moved off the symmetric set by a share of the clock's own swing if it lies on it; else the same bits.

    The seed is that of the direction. `UsageError` if the clocks rest, where no share of a swing moves them.
    """
    if not symmetric(system, state):
        return state
    moved = np.array(state, dtype=np.float64)
    last = moved[system.first_angle + 2 :]
    size = float(np.abs(last).max())
    if size == 0.0:
        raise UsageError("both clocks are at rest, and van der Pol's drive cannot start them; give one a swing")
    last += share * size * generator(seed, "off the symmetric set").uniform(0.5, 1.0, size=last.size)
    return moved


def jacobian(function: Callable[[Any], Any], point: Floats) -> Floats:
    """Of an analytic function (n,) -> (m,), (m, n): steps into the complex plane are too short to err."""
    moved = point + 1j * _STEP * np.eye(point.size)
    return np.stack([function(each).imag / _STEP for each in moved], axis=1)


def eigenvalues_beside(matrix: Floats, neutral: Floats) -> list[complex]:
    """Of a linear map, less the one that belongs to the direction which it keeps."""
    others = np.linalg.qr(np.column_stack([neutral, np.eye(neutral.size)]))[0][:, 1:]
    return [complex(each) for each in np.linalg.eigvals(others.T @ matrix @ others)]
