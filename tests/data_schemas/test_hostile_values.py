"""Values and words that no honest record has: refused by name when it is read, in one line that a terminal may show."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import h5py
import pytest

from data_schemas import validate, write
from data_schemas.contents import IDENTIFIER, identifier
from pipeline.batch.summary import defused


def attribute(name: str, value: Any, at: str = "/") -> Callable[[h5py.File], None]:
    return lambda file: file[at].attrs.create(name, value)


def value(at: str, number: float) -> Callable[[h5py.File], None]:
    return lambda file: file[at].__setitem__(Ellipsis, number)


def late(file: h5py.File) -> None:
    file["time"][-1] = 1e9


def relabelled(text: str) -> Callable[[h5py.File], None]:
    return lambda file: file["record/pendulum"].__setitem__(0, text)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (attribute("record_id", "x" * 60_000), "attribute record_id: "),
        (attribute("record_id", "=1+2"), "is no identifier"),
        (attribute("record_id", "a\x1b[31m"), "is no identifier"),
        (relabelled("b\x1b[2J"), "record/pendulum: 'b"),
        (relabelled("b" * 65), "is no label; give 1 to 64 printable letters"),
        (value("record/combination", 1e300), "record/combination: 1e+300 is no value in 1"),
        (value("instrument/period", 1e-300), "instrument/period: 1e-300 is no value in s"),
        (value("instrument/reference_gravity", 1e-300), "instrument/reference_gravity: 1e-300 is no value in m s-2"),
        (value("record/elongation", 1e300), "record/elongation: 1e+300 is no value in rad"),
        (attribute("add_offset", 1e308, "record/elongation"), "record/elongation: 1e+308 is no value in rad"),
        (late, "split the record at its gaps"),
    ],
)
def test_no_pendulum_has_it(tmp_path, record, spoil: Callable[[h5py.File], None], said: str) -> None:
    path = tmp_path / "file.nc"
    write(record, path)
    with h5py.File(path, "r+") as file:
        del file.attrs["content_sha256"]
        spoil(file)
    faults = validate(path)
    assert any(said in fault for fault in faults), faults
    assert all(fault.isprintable() and len(fault) < 400 for fault in faults)


@pytest.mark.parametrize(("times", "refused"), [(19.0, False), (21.0, True)])
def test_readings_reach_over_twenty_times_their_time_at_most(times: float, refused: bool, tmp_path, record) -> None:
    """A gap of 90 times a record's length took more than a minute."""
    path = tmp_path / "file.nc"
    write(record, path)
    with h5py.File(path, "r+") as file:
        del file.attrs["content_sha256"]
        time = file["time"]
        time[-1] = time[0] + times * time.size * (time[1] - time[0])
    assert any("split the record" in fault for fault in validate(path)) == refused


def test_names_of_files_become_identifiers() -> None:
    for text in ("Ship 3, day 1", "\x1b[31m", "", "ä" * 99, "=1+2"):
        assert IDENTIFIER.fullmatch(identifier(text))


@pytest.mark.parametrize("text", ["=1+2", "+1", "-1", "@a", "\t=1", "\r=1"])
def test_no_cell_is_a_formula(text: str) -> None:
    assert defused(text) == f"'{text}"
    assert defused(f"a{text}") == f"a{text}"


def test_pictures_show_what_files_say_as_it_is(tmp_path) -> None:
    """As a formula, "$x^{" ends in an error; a control character in a warning."""
    pytest.importorskip("matplotlib")
    from pipeline.plots.canvas import panel, save, sheet

    figure = sheet("of $x^{$", "$", 5.0, 4.0)
    panel(figure, figure.add_gridspec(1, 1)[0], "a\x1b$b^{$").set_xscale("log")
    save(figure, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1000
