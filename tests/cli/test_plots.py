"""Figures: what they draw is what the file holds, and every word on them can be read."""

from __future__ import annotations

import re

import numpy as np
import pytest
from made_trees import ERRORS, GRAVITY, METHODS, made_period_result, made_record, made_result

from data_schemas.errors import FileError
from pipeline.period.cycles import arc_factor
from pipeline.plots.canvas import PALETTE, angle_scale, robust_limits, running_mean, save, time_scale
from pipeline.plots.result import best_method, demo_figure, period_figure, record_figure, result_figure

FIGURES = {
    "record": lambda: record_figure(made_record(gap=10)),
    "long record": lambda: record_figure(made_record(30000)),
    "record of marks": lambda: record_figure(made_record(200, step=0.5)),
    "result": lambda: result_figure(made_result()),
    "result with truth": lambda: result_figure(made_result(), true_gravity=GRAVITY),
    "period": lambda: period_figure(made_period_result()),
    "demo": lambda: demo_figure(made_record(5000), made_result(), GRAVITY),
}


@pytest.fixture(params=FIGURES, scope="module")
def figure(request):
    drawn = FIGURES[request.param]()
    drawn.draw_without_rendering()
    return drawn


def boxes(texts):
    return [text.get_window_extent() for text in texts if text.get_visible() and text.get_text()]


def test_every_axis_says_its_quantity_and_unit(figure):
    unit = r", (s|min|h|mrad|rad|µrad|%|mGal|Hz|rad²/Hz)( |$)|mGal from|seconds after"
    for axes in figure.axes:
        assert axes.get_title(loc="left")
        labels = [axes.get_ylabel()]
        if axes.get_subplotspec().is_last_row() or "Cycle" not in axes.get_title(loc="left"):
            labels.append(axes.get_xlabel())
        for label in labels:
            named = label or "".join(text.get_text() for text in axes.get_yticklabels())
            assert re.search(unit, label) or METHODS[0] in named, label


def test_no_two_words_lie_on_each_other_and_none_leaves_the_sheet(figure):
    everywhere = boxes(figure.texts)
    for axes in figure.axes:
        inside_x = [tick.label1 for tick in axes.xaxis.get_major_ticks()]
        inside_y = [tick.label1 for tick in axes.yaxis.get_major_ticks()]
        low, high = axes.get_xlim()
        inside_x = [text for text in inside_x if low <= text.get_position()[0] <= high]
        low, high = axes.get_ylim()
        inside_y = [text for text in inside_y if low <= text.get_position()[1] <= high]
        titles = [axes.xaxis.label, axes.yaxis.label, axes._left_title]
        everywhere += boxes([*inside_x, *inside_y, *titles])
        if axes.get_legend() is not None:
            everywhere += boxes(axes.get_legend().get_texts())
    for index, one in enumerate(everywhere):
        assert figure.bbox.contains(one.x0, one.y0)
        assert figure.bbox.contains(one.x1, one.y1)
        for other in everywhere[:index]:
            # tick labels may touch at their (empty) edges
            assert not one.padded(-1).overlaps(other.padded(-1)), (one, other)


def test_the_heading_names_the_record(figure):
    assert any("record hand-made" in text.get_text() for text in figure.texts)


def relative_luminance(colour):
    linear = [value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in colour]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_the_first_colours_are_told_apart_without_red_and_green():
    from matplotlib.colors import to_rgb

    # Machado, Oliveira and Fernandes (2009), table 1: severity 1.0, rows of the matrices for linear RGB
    blind = {
        "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    }  # fmt: skip
    for matrix in blind.values():
        seen = [np.array(matrix) @ np.array(to_rgb(colour)) for colour in PALETTE[:4]]
        for index, one in enumerate(seen):
            for other in seen[:index]:
                assert np.abs(one - other).max() > 0.15


def test_a_gap_in_a_record_stays_open():
    axes = record_figure(made_record(200, step=0.5, gap=10)).axes[0]
    assert np.isnan(axes.lines[0].get_ydata()).sum() == 10


def test_the_envelope_of_a_long_record_reaches_its_extremes():
    record = made_record(30000)
    band = record_figure(record).axes[2].collections[0].get_paths()[0].vertices
    swing = record["record"]["elongation"].values[1] * 1e3
    # the band is drawn in mrad; its corners are the extremes themselves
    assert band[:, 1].max() == np.nanmax(swing)
    assert band[:, 1].min() == np.nanmin(swing)


def test_the_corrected_phase_speed_is_measured_plus_correction_as_gravity():
    axes = result_figure(made_result()).axes[2]
    before, after = (line.get_ydata() for line in axes.lines[:2])
    # made_result leaks 3e-4 rad/s into the difference and takes all of it but 2e-6 off again:
    # 2 g dn/n = 94.6 mGal; means of 40 s, twice, of a beat of 126 s keep (sin(1)/1)^2 = 0.71 of it
    assert np.ptp(before[100:-100]) / 2 == pytest.approx(94.6 * np.sin(1.0) ** 2, rel=0.02)
    assert np.abs(after[100:-100]).max() < 1.0


def test_the_corrected_line_lies_on_the_value_that_is_stated():
    axes = result_figure(made_result()).axes[2]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "phase speed as measured",
        "corrected (projection)",
    ]
    assert abs(np.nanmean(axes.lines[1].get_ydata())) < 0.01
    assert f"{GRAVITY + 1e-5 * ERRORS[-1]:.7f}" in axes.get_ylabel()


def test_the_residual_is_drawn_with_its_size_and_spectrum():
    figure = result_figure(made_result())
    assert figure.axes[3].get_legend().get_texts()[0].get_text().startswith("rms ")
    assert figure.axes[4].lines[0].get_ydata().tolist() == [1e-11] * 64


def test_errors_of_methods_are_drawn_where_they_are():
    axes = result_figure(made_result(), true_gravity=GRAVITY).axes[1]
    points = axes.lines[1].get_xdata()
    # float64 gravity near 10 resolves 2e-15 m/s2 = 2e-10 mGal
    np.testing.assert_allclose(points, ERRORS, atol=1e-9)
    assert "−41 ± 0.05" in axes.get_yticklabels()[0].get_text()


def test_a_refused_method_is_named_and_not_drawn():
    result = made_result()
    result["gravity"]["gravity"].values[2] = np.nan
    result["gravity"]["gravity_sigma"].values[2] = np.nan
    axes = result_figure(result).axes[1]
    assert axes.get_yticklabels()[2].get_text() == "panteleev\nrefused"
    assert axes.lines[1].get_xdata().size == len(METHODS) - 1


def test_a_result_without_any_gravity_or_phase_is_drawn_with_a_remark():
    result = made_result()
    result["gravity"]["gravity"].values[:] = np.nan
    assert best_method(result) is None
    figure = result_figure(result)
    assert "no method gave a gravity" in figure.texts[1].get_text()
    del result["phases"]
    assert result_figure(result).axes[0].texts[0].get_text() == "the result holds no phases"


def test_a_result_without_a_corrected_phase_speed_says_so():
    result = made_result()
    result["correction"].dataset = result["correction"].to_dataset(inherit=False).drop_vars("corrected_gravity")
    assert "no method gave a corrected" in result_figure(result).axes[2].texts[0].get_text()


def test_a_zoom_without_readings_says_so():
    record = made_record(3000)
    record["record"]["elongation"].values[:, 1000:2000] = np.nan
    assert record_figure(record).axes[1].texts[0].get_text() == "no reading here"


def test_the_fitted_scale_of_the_amplitude_is_said_and_its_cycles_drawn():
    result = made_period_result()
    made = {"amplitude_scale": ((), -0.0039), "flag": ("flag", np.array(["amplitude-scale"], dtype=object))}
    result["period"].dataset = result["period"].to_dataset(inherit=False).assign(made)
    recorded, fitted = period_figure(result).axes[1].lines[:2]
    assert recorded.get_label() == "amplitude as recorded"
    assert fitted.get_label() == "amplitude times 0.9961, as fitted"
    table = result["period"]
    reduced = table["cycle_period"].values / arc_factor(0.9961 * table["amplitude"].values)
    np.testing.assert_allclose(fitted.get_ydata(), 100 * (reduced / 1.029 - 1), atol=1e-12)


def test_a_period_without_smoothing_is_drawn_too():
    result = made_period_result()
    table = result["period"].to_dataset(inherit=False).drop_vars("cycle_period_smoothed")
    result["period"].dataset = table
    figure = period_figure(result)
    assert [len(axes.lines) for axes in figure.axes] == [2, 2]


def test_scales_suit_their_size():
    assert time_scale(1e6) == (1 / 3600, "h")
    assert angle_scale(0.5)[1] == "rad"
    low, high = robust_limits(np.append(np.linspace(-1, 1, 1000), 1e9))
    assert -2 < low < -1 < 1 < high < 2
    assert robust_limits(np.full(3, np.nan)) == (-1.0, 1.0)


def test_the_running_mean_is_the_mean_of_its_window():
    time = np.sort(np.random.default_rng(2).uniform(0, 100, 300))
    values = np.sin(time)
    values[50:60] = np.nan
    mean = running_mean(time, values, 10.0)
    for index in (0, 55, 150, 299):
        window = values[np.abs(time - time[index]) <= 5.0]
        # the sums run over 300 values of size 1: a few hundred rounding errors
        np.testing.assert_allclose(mean[index], np.nan if index == 55 else np.nanmean(window), atol=1e-13)


def test_a_picture_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    figure = FIGURES["period"]()
    with pytest.raises(FileError, match="cannot be written"):
        save(figure, tmp_path / "none" / "a.png")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(figure), "savefig", full)
    with pytest.raises(FileError, match=r"a\.png: cannot be written \(No space left"):
        save(figure, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []
