"""Two pendulums alike on one support that begin alike: in theory and in floating point they stay so for ever."""

from __future__ import annotations

from typing import Any

import numpy as np

from synth.phase import Floats

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
    >>> from synth.systems.metronomes import Metronomes
    >>> pair = Metronomes(np.array([6.0, 6.0]), 0.1)
    >>> symmetric(pair, np.array([2.0, 0.0, -2.0, 0.0]))
    True
    >>> symmetric(pair, np.array([2.0, 0.0, -1.999, 0.0]))
    False
    """
    pairs = np.asarray(state, dtype=np.float64)[system.first_angle :].reshape(-1, 2)
    own = [np.asarray(getattr(system, name)) for name in _OWN if hasattr(system, name)]
    own += _arrays(getattr(system, "terms", None))
    if len(pairs) != 2 or not all(np.all(each == each.flat[0]) for each in own):
        return False
    return bool(np.array_equal(pairs[0], pairs[1]) or np.array_equal(pairs[0], -pairs[1]))


def _arrays(term: Any) -> list[Floats]:
    if term is None:
        return []
    fields = [getattr(term, name) for name in term._fields]
    return [each for value in fields for each in ([value] if isinstance(value, np.ndarray) else _arrays(value))]
