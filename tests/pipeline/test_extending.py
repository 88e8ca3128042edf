"""Methods and corrections of a user's own: the examples of the documents run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from made_records import changed, row, simulate

from data_schemas import check, variables
from data_schemas.errors import UsageError
from pipeline import process, register_correction, register_method, summaries
from pipeline.ledger import book
from pipeline.methods import DECLARED

DOCUMENT = Path(__file__).parents[2] / "docs" / "extending.md"


@pytest.fixture
def examples(monkeypatch):
    """The document's code, run; what it registers is forgotten afterwards."""
    monkeypatch.setattr(book, "GIVEN", list(book.GIVEN))
    before, rows = dict(DECLARED), dict(variables._ROWS)
    space: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.S):
        exec(code, space)
    yield space
    for table, old in ((DECLARED, before), (variables._ROWS, rows)):
        table.clear()
        table.update(old)


def test_the_method_gives_what_panteleev_gives(examples) -> None:
    record, _ = simulate(noise=1e-6)
    own, theirs = row(record, "my-panteleev"), row(record, "panteleev")
    assert own["gravity_m_s2"] == pytest.approx(theirs["gravity_m_s2"], abs=1e-9)
    assert own["method"] == "my-panteleev"
    given = summaries(process(record, method=examples["my_panteleev"]))[0]
    assert given["gravity_m_s2"] == own["gravity_m_s2"]


def test_the_correction_is_in_the_ledger_and_in_gravity(examples) -> None:
    plain, _ = simulate()
    record = changed(plain, "instrument", "near_mass_pull", 0.25)
    record = changed(record, "instrument", "near_mass_pull_uncertainty", 0.05)
    assert check(record, "record") == []
    with_it, without = row(record, "projection"), row(plain, "projection")
    assert (with_it["gravity_m_s2"] - without["gravity_m_s2"]) / 1e-5 == pytest.approx(0.25, abs=1e-6)
    assert with_it["corrections_mgal"]["near_mass"] == pytest.approx(0.25, abs=1e-6)
    expected = np.hypot(without["gravity_sigma_mgal"], 0.05)
    assert with_it["gravity_sigma_mgal"] == pytest.approx(expected)


def test_names_of_the_package_are_taken() -> None:
    with pytest.raises(UsageError, match="one of the package"):
        register_method("joint", lambda _: None)
    with pytest.raises(UsageError, match="in the ledger already"):
        register_correction(book.GIVEN[0])


def test_a_result_tells_itself() -> None:
    result = process(simulate()[0], method=["projection", "uncorrected"])
    own = result.isochrony
    assert [each["method"] for each in own.summary()] == ["projection", "uncorrected"]
    assert own.table().loc[("made", "projection"), "gravity_m_s2"] == own.summary()[0]["gravity_m_s2"]
    assert "g = 9.8" in own._repr_html_()
    assert own.plot().axes
