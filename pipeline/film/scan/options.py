"""What a user may say about the image of a film; everything is told from the image where left out."""

from __future__ import annotations

from dataclasses import dataclass

from data_schemas.errors import UsageError

ORIENTATIONS = ("auto", "0", "90", "180", "270")
LINES = ("auto", "dark", "light")


@dataclass(frozen=True)
class ScanOptions:
    """How the image is to be taken.

    Attributes
    ----------
    dpi : float or None
        Pixels per inch; None: as the file says.
    orientation : str
        Degrees by which the image is turned clockwise so that time runs downwards: "0", "90", "180", "270"; "auto"
        puts the long side down, its left end up.
    lines : str
        "dark" on light film, "light" on dark film, or "auto": what departs from the blank film decides.
    """

    dpi: float | None = None
    orientation: str = "auto"
    lines: str = "auto"

    def __post_init__(self) -> None:
        if self.dpi is not None and not 10.0 <= self.dpi <= 20_000.0:
            raise UsageError(f"dpi {self.dpi:g}: give 10 to 20000 pixels per inch")
        for name, known in (("orientation", ORIENTATIONS), ("lines", LINES)):
            value = getattr(self, name)
            if value not in known:
                raise UsageError(f"{name} '{value}': give one of {', '.join(known)}")
