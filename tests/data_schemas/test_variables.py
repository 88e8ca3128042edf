"""The table of variables holds together: each row can be attached, stored and explained."""

from __future__ import annotations

import numpy as np
import pytest

from data_schemas.layouts import LAYOUTS
from data_schemas.variables import VARIABLES, attributes, same_unit

GROUPS = {group for layout in LAYOUTS.values() for group in (*layout.groups, layout.root)}


@pytest.mark.parametrize("name", VARIABLES)
def test_a_row_is_whole(name):
    row, group = VARIABLES[name], name.rpartition("/")[0]
    assert group in GROUPS
    assert row.units
    assert row.long_name
    assert row.dtype in {"f8", "u1", "u2", "str"}
    assert same_unit(row.units, row.units)
    attrs = attributes(name)
    assert attrs["units"] == row.units
    assert attrs["long_name"] == row.long_name
    attrs["units"] = "changed"
    assert attributes(name)["units"] == row.units


def test_the_flags_are_the_contract():
    attrs = attributes("record/elongation_qc")
    assert attrs["flag_masks"].tolist() == [1, 2, 4, 8, 16, 32, 64, 128, 256]
    assert attrs["flag_masks"].dtype == np.uint16
    assert attrs["flag_meanings"].split()[3:6] == ["time_mark", "ambiguous", "lost"]


@pytest.mark.parametrize(
    ("given", "wanted", "same"),
    [
        ("m/s2", "m s-2", True),
        ("m s**-2", "m s-2", True),
        (" rad ", "rad", True),
        ("radians", "rad", True),
        ("deg", "rad", False),
        ("", "1", True),
        (1, "1", True),
        (1, "s", False),
        (None, "s", False),
        ("ms", "s", False),
        ("Hz", "rad s-1", False),
        ("seconds since 1958-07-01T06:00:00Z", "seconds since 2000-01-01", True),
        ("days since 1958-07-01", "seconds since 2000-01-01", False),
        ("seconds", "seconds since 2000-01-01", False),
    ],
)
def test_units_that_mean_the_same(given, wanted, same):
    assert same_unit(given, wanted) is same
