"""A film drawn with what was read of it, whole or in part, and one that could not be read."""

from __future__ import annotations

import numpy as np
import pytest
from film_stand_ins import reading

from data_schemas.errors import UsageError
from pipeline.plots.canvas import save
from pipeline.plots.film import film_figure, picture, unread_figure

pytest.importorskip("matplotlib")


def test_whole_film_is_drawn_in_strips_with_marks_and_names(tmp_path):
    figure = film_figure(reading(tmp_path, seconds=100.0))
    panels = [axes for axes in figure.axes if axes.images]
    assert len(panels) == 4  # of at most half a minute each
    assert any("1 min" in text.get_text() for axes in panels for text in axes.texts)
    assert any("100.0 % of the rows read" in text.get_text() for text in figure.texts)
    save(figure, tmp_path / "film.png")
    assert (tmp_path / "film.png").read_bytes().startswith(b"\x89PNG")


def test_a_part_is_drawn_to_the_second(tmp_path):
    figure = film_figure(reading(tmp_path), 20.0, 25.0)
    (axes,) = [axes for axes in figure.axes if axes.images]
    assert axes.get_xlim() == pytest.approx((1200.0, 1500.0), abs=1.0)
    assert "22 s" in [label.get_text() for label in axes.get_xticklabels()]
    with pytest.raises(UsageError, match=r"reaches from 0\.0 to 60\.0 s"):
        film_figure(reading(tmp_path), 100.0, 110.0)


def test_a_film_that_could_not_be_read_is_shown_with_the_reason(tmp_path):
    figure = unread_figure(reading(tmp_path).scan, "night.tif: no trace")
    assert any(text.get_text() == "night.tif: no trace" for text in figure.texts)
    assert figure.axes[0].images


def test_thin_lines_survive_however_much_the_picture_shrinks(tmp_path):
    scan = reading(tmp_path).scan
    scan.image.read(0, scan.rows)[:, 700] = 40
    grey = picture(scan, 0, 3600, 0, 1500, 200)
    assert grey.shape == (200, 750)
    assert grey[:, 350].max() < 0.5
    assert np.delete(grey, 350, axis=1).min() > 0.9


def test_the_heading_says_what_was_read_at_the_marks(tmp_path):
    figure = film_figure(reading(tmp_path, kind="strobe"))
    assert any("100.0 % of the places at the marks read" in text.get_text() for text in figure.texts)
