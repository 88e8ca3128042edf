"""A scan that cannot be read is told what is wrong with it, not with the pendulums."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from data_schemas.errors import RefusedError
from pipeline.film.following import find_time
from pipeline.film.knowledge import Known
from pipeline.film.scan.files import in_memory
from pipeline.film.scan.opening import OpenScan, cause_in

DPI = 25.4


def film(seed: int = 1) -> np.ndarray:
    """Grain, and a curve that swings."""
    rng = np.random.default_rng(seed)
    row, column = np.arange(600.0)[:, None], np.arange(320.0)
    line = np.exp(-0.5 * ((column - 160.0 - 90.0 * np.sin(row / 9.0)) / 2.0) ** 2)
    return np.clip(220.0 - 180.0 * line + 6.0 * rng.standard_normal((600, 320)), 0, 255)


def compressed(pixels: np.ndarray, quality: int) -> np.ndarray:
    """As a JPEG keeps it."""
    kept = io.BytesIO()
    PIL.Image.fromarray(np.round(pixels).astype(np.uint8)).save(kept, "JPEG", quality=quality)
    return np.asarray(PIL.Image.open(kept))


def scan(pixels: np.ndarray, dpi: float = 300.0) -> OpenScan:
    path = Path("night.film.tif")
    return OpenScan(in_memory(np.round(pixels).astype(np.uint8), path), DPI / dpi, (path,))


@pytest.mark.parametrize("seed", range(5))
def test_a_good_scan_has_no_fault(seed: int) -> None:
    assert cause_in(scan(film(seed))) is None
    assert cause_in(scan(compressed(film(seed), 90))) is None


@pytest.mark.parametrize(
    ("pixels", "dpi", "words"),
    [
        (film(), 100.0, "100 dpi, too few for its lines: scan at 300 dpi"),
        (200.0 + 0.1 * film(), 300.0, "of the grey levels: scan with more contrast"),
        (np.where(film() < 128.0, 0.0, 255.0), 300.0, "2 grey levels: scan in grey with 8 bits"),
        (compressed(film(), 30), 300.0, "compression shows as squares of 8 pixels: save the scan as TIFF"),
    ],
)
def test_each_fault_is_named_with_its_remedy(pixels: np.ndarray, dpi: float, words: str) -> None:
    assert words in str(cause_in(scan(pixels, dpi)))


@pytest.mark.compiled  # a whole film is searched
def test_a_refusal_names_it_first() -> None:
    blank = 220.0 + 6.0 * np.random.default_rng(3).standard_normal((600, 320))
    blank[::7, ::5] = 60.0
    with pytest.raises(RefusedError, match=r"^the scan has 100 dpi, too few for its lines"):
        find_time(scan(blank, 100.0), Known())
