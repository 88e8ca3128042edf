"""Kinds of record of the suite `corrections`, and what the methods must show on each.

On noise-free linear pendulums it is known which method is right and by how much, to the order of magnitude, the others
are wrong. The sizes of wrong methods depend on phases and swell, so they are judged by their root mean square over
several swells. On real pendulums a value is judged by its own sigma; a flag excuses no error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pipeline.benchmarks.honesty.records import Made, record
from pipeline.benchmarks.scenes import resonant, swell, two_pendulums
from pipeline.benchmarks.trials import made

SWELLS = (24, 25, 26, 27, 28, 29)
"""Seeds of the swell; the records that are shown have the first."""
_EXACT = {"projection": 1e-3, "complex": 1e-2}
_INTEGRATED = _EXACT | {"panteleev": 1e-2, "general": 1e-2}
_PHASE_METHODS = ("uncorrected", "vening-meinesz", "panteleev", "general")


@dataclass(frozen=True)
class Kind:
    """One kind of record.

    Attributes
    ----------
    record : callable
        The seed of the swell gives the record.
    right : dict
        Largest error, mGal, of the methods that are right here.
    wrong : dict
        Least root mean square error over the swells, mGal, of the methods that are wrong: a fifth of what is found.
    refused : tuple of str
        Methods that may decline: a phase means nothing where the amplitude vanishes.
    real : bool
        Real pendulums, where a value of the methods made for them must hold within its sigma.
    """

    name: str
    record: Callable[[int], Made]
    right: Mapping[str, float] = field(default_factory=dict)
    wrong: Mapping[str, float] = field(default_factory=dict)
    refused: tuple[str, ...] = ()
    real: bool = False


def kinds(*, quick: bool) -> list[Kind]:
    """All kinds: linear pendulums, then real ones, whose records are shorter when quick."""
    return [
        *LINEAR,
        *(Kind(name, partial(_real, name, 600.0 if quick else None), real=True) for name in REAL),
    ]


def _real(kind: str, duration: float | None, seed: int) -> Made:
    return record(kind, "middle", seed, duration=duration)


def _linear(name: str, difference: float, *more: dict[str, Any], **changes: Any) -> Callable[[int], Made]:
    return lambda seed: made(two_pendulums(name, difference, motion=[swell(seed=seed), *more], **changes))


LINEAR = (
    Kind(
        "linear, eps 1e-5, near-resonant",
        _linear("eps-1e-5-resonant", 1e-5, resonant()),
        _INTEGRATED,
        {"uncorrected": 0.9, "vening-meinesz": 0.6},
    ),
    Kind("linear, eps 1e-4", _linear("eps-1e-4", 1e-4), _INTEGRATED, {"uncorrected": 2.8, "vening-meinesz": 8.0}),
    Kind(
        "linear, eps 1e-3",
        _linear("eps-1e-3", 1e-3),
        _EXACT | {"panteleev": 0.1},
        {"uncorrected": 13.0, "vening-meinesz": 260.0},
    ),
    Kind(
        "linear, eps 1e-4, 50/40 mrad",
        _linear("eps-1e-4-heavy", 1e-4, amplitudes=(0.05, 0.04)),
        _INTEGRATED,
        {"uncorrected": 26.0, "vening-meinesz": 10.0},
    ),
    Kind(
        "linear, eps 1e-3, beats through zero",
        _linear("eps-1e-3-zero", 1e-3, amplitudes=(0.01, 0.01)),
        _EXACT,
        refused=_PHASE_METHODS,
    ),
)
"""Noise-free linear pendulums in swell; eps is the relative difference of the periods."""

REAL = (
    "swell", "near-resonant", "heave recorded", "large arcs", "dampings that differ", "reading noise",
    "few samples a swing", "short record",
)  # fmt: skip
"""Kinds of the suite `honesty`, at its middle strength, on which also the paper's formulas and the exact identities are
tried."""
