"""Strips of one film, shifted and turned, are laid where they belong; what fits nowhere, or twice, is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from data_schemas.errors import FileError
from pipeline.film.scan.files import ImageFile, in_memory
from pipeline.film.scan.strips import join, place

A, B = Path("a.tif"), Path("b.tif")


def film(rows: int = 1400, columns: int = 260, seed: int = 0, drift: float = 0.3) -> np.ndarray:
    """Light film with grain, a wave whose middle wanders, and gaps that wander through its swings."""
    rng = np.random.default_rng(seed)
    r = np.arange(rows)[:, None]
    line = 0.5 * columns + 70.0 * np.sin(2 * np.pi * r / 60.0) + 100.0 * drift * np.sin(2 * np.pi * r / 431.0)
    width = 1.3 * np.sqrt(1.0 + (70.0 * 2 * np.pi / 60.0 * np.cos(2 * np.pi * r / 60.0)) ** 2)
    dark = 90.0 * np.exp(-0.5 * ((np.arange(columns) - line) / width) ** 2) * (np.abs(r % 29.7 - 14.0) > 1.5)
    return 210.0 - dark + 4.0 * rng.standard_normal((rows, columns))


def cut(pixels: np.ndarray, row: float, column: float, turn: float, rows: int, columns: int | None = None) -> ImageFile:
    """The strip whose pixel (r, c) is the film's (row + r cos + c sin, column + c cos - r sin)."""
    i, j = np.mgrid[0:rows, 0 : columns or pixels.shape[1]].astype(float)
    at = [row + i * np.cos(turn) + j * np.sin(turn), column + j * np.cos(turn) - i * np.sin(turn)]
    values = map_coordinates(pixels, at, order=3, mode="nearest")
    return in_memory(np.clip(np.round(values), 0, 255).astype(np.uint8), B)


@pytest.mark.parametrize(
    ("row", "column", "turn"),
    [(600.0, 0.0, 0.0), (650.37, -3.61, 0.0), (500.2, 5.3, 1e-3), (400.5, 0.5, -2e-3)],
)
def test_a_strip_is_laid_where_it_was_cut_to_a_part_of_a_pixel(row, column, turn):
    pixels = film()
    before = in_memory(np.clip(np.round(pixels[:900]), 0, 255).astype(np.uint8), A)
    found = place(before, cut(pixels, row, column, turn, 700))
    assert found.is_certain
    # the strip's corners, where an error of the turn shows most
    for r, c in ((0, 0), (0, 260), (500, 0), (500, 260)):
        assert abs(found.offset.real + c * np.sin(found.turn) - row - c * np.sin(turn)) < 0.1, (r, c)
        assert abs(found.offset.imag - r * np.sin(found.turn) - column + r * np.sin(turn)) < 0.1, (r, c)


def test_whole_pixels_are_copied_exactly():
    pixels = np.clip(np.round(film()), 0, 255).astype(np.uint8)
    strips = [in_memory(pixels[:600], A), in_memory(pixels[350:1000], B)]
    strips.append(in_memory(pixels[800:], Path("c.tif")))
    joined = join(strips, [A, B, Path("c.tif")])
    assert joined.rows == 1400
    np.testing.assert_array_equal(joined.read(0, 1400), pixels)
    np.testing.assert_array_equal(joined.read(470, 481), pixels[470:481])


def test_a_shifted_and_turned_strip_shows_the_film_undisturbed():
    pixels = film()
    before = in_memory(np.clip(np.round(pixels[:800]), 0, 255).astype(np.uint8), A)
    joined = join([before, cut(pixels, 500.4, 2.7, 1.5e-3, 800)], [A, B])
    shown = joined.read(0, joined.rows)
    first = 651  # where the second strip takes over
    wrong = (shown[first : joined.rows - 3] - pixels[first : joined.rows - 3])[:, 12:-12]
    assert abs(wrong.mean()) < 0.05
    assert wrong.std() < 4.0  # the grain, twice interpolated
    np.testing.assert_array_equal(joined.read(first + 5, first + 9), shown[first + 5 : first + 9])


def test_strips_that_do_not_overlap_or_come_in_the_wrong_order_are_refused():
    pixels = np.clip(np.round(film()), 0, 255).astype(np.uint8)
    parts = [in_memory(pixels[:700], A), in_memory(pixels[700:], B)]
    with pytest.raises(FileError, match=r"b\.tif: .*a\.tif; give the strips in the order of time"):
        join(parts, [A, B])
    parts = [in_memory(pixels[500:], B), in_memory(pixels[:800], A)]
    with pytest.raises(FileError, match="in the order of time"):
        join(parts, [B, A])


def test_a_film_that_repeats_itself_is_not_laid_at_a_guess():
    r = np.arange(900)[:, None]
    line = 130.0 + 70.0 * np.sin(2 * np.pi * r / 60.0)
    clean = 210.0 - 90.0 * np.exp(-0.5 * ((np.arange(260) - line) / 4.0) ** 2)
    noise = np.random.default_rng(0).standard_normal((2, 900, 260))  # of the scanner: not the same twice
    one, two = (np.clip(np.round(clean + 4.0 * each), 0, 255).astype(np.uint8) for each in noise)
    with pytest.raises(FileError, match="fits at several places"):
        join([in_memory(one[:600], A), in_memory(two[300:], B)], [A, B])


def test_strips_of_different_depth_are_refused():
    pixels = np.clip(np.round(film()), 0, 255).astype(np.uint8)
    with pytest.raises(FileError, match="8 and 16 bits"):
        join([in_memory(pixels, A), in_memory(pixels.astype(np.uint16), B)], [A, B])
