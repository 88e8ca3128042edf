"""How the pictures of the suite `corrections` tell methods apart: a colour and a mark each."""

from __future__ import annotations

from pipeline.methods import PAIR_METHODS
from pipeline.plots.canvas import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION

FLOOR = 1e-8  # mGal: below it lies rounding
DRAWN = PAIR_METHODS

MARKS: dict[str, tuple[str, str]] = {
    "uncorrected": (SKY, "v"),
    "vening-meinesz": (VERMILION, "^"),
    "panteleev": (ORANGE, "s"),
    "general": (BLUE, "D"),
    "complex": (PURPLE, "P"),
    "projection": (GREEN, "X"),
    "shooting": ("#000000", "o"),
}
"""Method -> colour, mark."""
