"""What each propagator must do with each extreme motion, written down beforehand.

A propagator that is not made for a kind of motion declines it. The others must meet the bound, unless the cell is
named here with the reason for which it may decline, or must.
"""

from __future__ import annotations

from collections.abc import Mapping

CLOSED, PICARD, COLLOCATION = "closed form", "Picard collocation", "beam collocation"
RADAU, EXPLICIT, SPLITTING = "Radau", "explicit", "splitting"
SIMULATE = "simulate"
"""The whole simulator, from a scene, with the propagator that it chooses."""
PROPAGATORS = (CLOSED, PICARD, COLLOCATION, RADAU, EXPLICIT, SPLITTING, SIMULATE)

SUITED: Mapping[str, tuple[str, ...]] = {
    "linear": (CLOSED, RADAU, EXPLICIT, SIMULATE),
    "overdamped": (RADAU, EXPLICIT, SIMULATE),
    "sine": (PICARD, RADAU, EXPLICIT, SPLITTING, SIMULATE),
    "heave": (RADAU, EXPLICIT),
    "oscillator": (RADAU, EXPLICIT),
    "beam": (COLLOCATION, RADAU, EXPLICIT, SIMULATE),
    "reduced": (RADAU, EXPLICIT),
    "table": (SIMULATE,),
}
"""Kind of motion -> propagators made for it."""

TOLERANCE = 1e-10
"""What is asked of propagators that take a tolerance."""
BOUND = 1e-8
"""Largest error, relative to the largest angle, of a cell that must be solved."""
BOUNDS: Mapping[tuple[str, str], float] = {
    ("exact resonance", CLOSED): 1e-13,
    ("resonance detuned by 1e-12", CLOSED): 1e-13,
    ("equal frequencies", CLOSED): 1e-14,
    ("1e7 s long, every 10 s", CLOSED): 1e-13,
    ("1 rad", PICARD): 1e-13,
}
"""Tighter bounds of single cells."""
_VIOLENT = "the motion is far from that of the linear pendulum about which it is expanded"
_STIFF = "stiff: the motion is far slower than what an explicit step can bear"
_LONG = "a million swings are the closed form's business"
_TOP = "on the separatrix rounding alone decides where the pendulum goes"
MAY_REFUSE: Mapping[tuple[str, str], str] = {
    ("overdamped, 1e4 /s", EXPLICIT): _STIFF,
    ("1e7 s long, every 10 s", EXPLICIT): _LONG,
    ("1e7 s long, every 10 s", RADAU): _LONG,
    ("free fall, z'' = -g", PICARD): _VIOLENT,
    ("free fall, z'' = -g", SPLITTING): _VIOLENT,
    ("beyond free fall, z'' = -2 g", PICARD): _VIOLENT,
    ("beyond free fall, z'' = -2 g", SPLITTING): _VIOLENT,
    ("several g", PICARD): _VIOLENT,
    ("several g", SPLITTING): _VIOLENT,
    ("over the top", PICARD): _VIOLENT,
    ("over the top", SPLITTING): _VIOLENT,
    ("3.1 rad", PICARD): _VIOLENT,
    ("3.1 rad", SPLITTING): _VIOLENT,
    ("3.14159 rad, to the other side", PICARD): _VIOLENT,
    ("3.14159 rad, to the other side", SPLITTING): _VIOLENT,
    ("on the separatrix, 2 s", PICARD): _VIOLENT,
    ("on the separatrix, 2 s", SPLITTING): _VIOLENT,
    **{("on the separatrix, 20 s", name): _TOP for name in (PICARD, RADAU, EXPLICIT, SPLITTING, SIMULATE)},
    ("escapement, delta = 1000", EXPLICIT): _STIFF,
    ("escapement, delta = 10000", EXPLICIT): _STIFF,
    **{(f"beam 1e{power} times stiffer", EXPLICIT): _STIFF for power in (2, 3, 4, 5, 6)},
    **{(f"beam 1e{power} times stiffer", COLLOCATION): _STIFF for power in (2, 3, 4, 5, 6)},
    ("read at 1 MHz", SIMULATE): "records are read 1e5 times a second at most",
    ("light beam, M/m = 1e-3", COLLOCATION): "the coupling is no small remainder",
}
"""Cells that may decline, each with its reason; a value given all the same must be honest."""
MUST_REFUSE: Mapping[str, str] = {
    "singular mass matrix of (2)": "there is no acceleration",
    "tabulated motion with a jump": "between two readings the motion is anything",
    "tabulated motion with NaN": "the motion is not known",
}
"""Cases of which any value would be wrong."""
NOT_ASKED: Mapping[tuple[str, str], str] = {
    ("1e7 s long, every 10 s", EXPLICIT): _LONG,
    ("1e7 s long, every 10 s", RADAU): _LONG,
}
"""Cells that would take minutes or hours."""


def bound(case: str, propagator: str) -> float:
    """Largest error of a cell that must be solved."""
    return BOUNDS.get((case, propagator), BOUND)
