"""Clocks that begin alike stay alike to the last bit: a start on the symmetric set, told and left.

Equal clocks with y_1 = +-y_2 and y_1' = +-y_2' keep that equality exactly, in the equations and in floating point: a
simulation then sits on the paper's regime, which is a saddle of system (2), and looks locked. Whoever asks what two
clocks do must begin beside it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from data_schemas.errors import UsageError
from synth.phase import Floats
from synth.seeds import generator

LIKELY = 1e-6
"""Share of the swing by which a start is moved: far above rounding, far below any reading."""
CAUTION = (
    "the clocks are alike and begin alike: they stay so to the last bit, on a motion that may be unstable; start one "
    "of them a little off, such as 1e-6 of its swing"
)
_OWN = ("mass", "length", "detuning", "natural_frequency")


def symmetric(system: Any, state: Floats) -> bool:
    """Whether a motion begins on the symmetric set: two clocks alike whose angles and rates agree but for one sign.

    Parameters
    ----------
    system : NamedTuple
        `ReducedBeam`, `ElasticBeam`, `FlexibleFrame` or `Metronomes`.
    state : (n,) array

    Examples
    --------
    >>> from synth.huygens.clocks import Clocks
    >>> pair = Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114)).small()
    >>> symmetric(pair, np.array([0.0, 0.0, 2.0, 0.0, -2.0, 0.0]))
    True
    >>> symmetric(pair, np.array([0.0, 0.0, 2.0, 0.0, -1.999, 0.0]))
    False
    """
    pairs = np.asarray(state, dtype=np.float64)[system.first_angle :].reshape(-1, 2)
    if len(pairs) != 2 or not _alike(system):
        return False
    return bool(np.array_equal(pairs[0], pairs[1]) or np.array_equal(pairs[0], -pairs[1]))


def perturbed(system: Any, state: Floats, seed: int, share: float = LIKELY) -> Floats:
    """The state, moved off the symmetric set if it lies on it; else the same bits.

    Parameters
    ----------
    system, state
        As for `symmetric`.
    seed : int
        Of the direction.
    share : float
        Of the clock's own swing.

    Raises
    ------
    UsageError
        If the clocks rest, where no share of a swing moves them.
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


def _alike(system: Any) -> bool:
    values = [np.asarray(getattr(system, name)) for name in _OWN if hasattr(system, name)]
    return all(np.all(each == each.flat[0]) for each in values + _arrays(getattr(system, "terms", None)))


def _arrays(term: Any) -> list[Floats]:
    if term is None:
        return []
    fields = [getattr(term, name) for name in term._fields]
    return [each for value in fields for each in ([value] if isinstance(value, np.ndarray) else _arrays(value))]
