"""What about a scan may be the cause that nothing, or too little, is read of it."""

from __future__ import annotations

import numpy as np

from pipeline.film.scan.image import Pixels
from pipeline.film.scan.opening import MM_PER_INCH, OpenScan

COARSE = 150.0  # dpi, below which a line of .1 mm is hardly wider than a pixel
FLAT = 0.12  # of the grey levels, that lines and film differ by at least
STEPS = 8  # grey levels, of a scan that has few
SQUARES, SQUARE = 1.25, 8  # step across the edges of JPEG's squares over that beside them; px
PIECES, ROWS = 5, 256


def cause_in(scan: OpenScan) -> str | None:
    """The likeliest fault of a scan that lies in the scan itself, with its remedy; None where it looks well."""
    if scan.scale is not None and (dpi := MM_PER_INCH / scan.scale) < COARSE:
        return f"the scan has {dpi:.0f} dpi, too few for its lines: scan at 300 dpi"
    firsts = np.linspace(0, max(0, scan.rows - ROWS), PIECES).astype(int).tolist()
    pieces = [scan.read(first, first + ROWS) for first in firsts]
    levels = np.unique(np.concatenate([np.unique(piece) for piece in pieces])).size
    if levels <= STEPS:
        return f"the scan has {levels} grey levels: scan in grey with 8 bits"
    if max(squares(piece) for piece in pieces) > SQUARES:
        return "compression shows as squares of 8 pixels: save the scan as TIFF or PNG, or as JPEG of quality 90"
    dark, light = np.quantile(np.concatenate([piece.ravel() for piece in pieces]), [0.001, 0.999])
    if light - dark < FLAT * scan.full_scale:
        share = 100.0 * (light - dark) / scan.full_scale
        return f"the pixels span {share:.0f} % of the grey levels: scan with more contrast"
    return None


def squares(pixels: Pixels) -> float:
    """Mean step from column to column across the edges of squares of 8 pixels, over that elsewhere."""
    step = np.abs(np.diff(pixels.astype(np.float32), axis=1))
    step = np.minimum(step, 4.0 * np.median(step) + 1.0).mean(axis=0)  # lines are steeper
    by_phase = np.array([step[phase::SQUARE].mean() for phase in range(SQUARE)])
    at = int(np.argmax(by_phase))
    return float(by_phase[at] / max(np.delete(by_phase, at).mean(), 1e-3))
