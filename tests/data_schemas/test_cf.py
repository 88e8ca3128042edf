"""CF conventions, by an independent checker, on a flattened copy: the checker does not look into groups."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from flat_copy import flatten

from data_schemas import write
from data_schemas.layouts import LAYOUTS

# what the checker gets wrong or CF does not know, and why we keep it
KNOWN = {
    'units for film__scale, "mm px-1" are not recognized by UDUNITS',  # pixels are no unit of UDUNITS
}
# the checker subtracts neighbouring values of every coordinate, also of labels (CF 6.1 allows text)
OWN_EXCEPTION = "check_coordinate_variables_strict_monotonicity: unsupported operand type(s) for -: 'str' and 'str'"


@pytest.fixture(scope="module")
def checker():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own dependencies
        from compliance_checker.runner import CheckSuite, ComplianceChecker

        CheckSuite.load_all_available_checkers()
    return ComplianceChecker


def _failures(checker, tree, folder, capsys) -> set[str]:
    """Messages of high and medium priority."""
    flat, told = folder / "flat.nc", folder / "told.json"
    write(flatten(tree), flat, overwrite=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the checker itself
        checker.run_checker(str(flat), ["cf:1.11"], 0, "lenient", output_filename=str(told), output_format="json")
    stumbles = [line for line in "".join(capsys.readouterr()).splitlines() if line.startswith("cf:1.11.")]
    assert set(stumbles) <= {f"cf:1.11.{OWN_EXCEPTION}"}
    results = json.loads(told.read_text())["cf:1.11"]
    assert results["high_count"] >= 0
    return {
        message
        for priority in ("high_priorities", "medium_priorities")
        for result in results[priority]
        for message in result["msgs"]
    }


@pytest.mark.parametrize("kind", LAYOUTS)
def test_each_kind_conforms(checker, tmp_path, example, capsys, kind):
    assert _failures(checker, example(kind), tmp_path, capsys) - KNOWN == set()


PLANTED = {  # what the checker's words name, and where what is planted
    "record__elongation,": ("record/elongation", {"units": "radianz"}),
    "instrument__latitude": ("instrument/latitude", {"units": "m"}),
    "ship_heading_of_ours": ("instrument/course", {"standard_name": "ship_heading_of_ours"}),
    "record__elongation_qc": ("record/elongation_qc", {"flag_meanings": "one two three"}),
}
TYPES = {"record__elongation_qc": ("record/elongation_qc", {"flag_masks": 2 ** np.arange(9, dtype=np.int64)})}


@pytest.mark.parametrize("planted", [PLANTED, TYPES], ids=["words", "types"])
def test_planted_faults_are_found(checker, tmp_path, example, capsys, planted):
    """All at once: the checker takes its time."""
    tree = example("record")
    for place, wrong in planted.values():
        tree[place].attrs.update(wrong)
    found = _failures(checker, tree, tmp_path, capsys) - KNOWN
    assert [name for name in planted if not any(name in message for message in found)] == []


def test_flattening_keeps_everything(example):
    tree = example("record")
    flat = flatten(tree)
    assert not flat.children
    assert flat["record__elongation"].dims == ("record__trace", "time")
    assert flat["instrument__period"].dims == ("instrument__pendulum",)
    count = sum(len(node.to_dataset(inherit=False).variables) for node in tree.subtree)
    assert len(flat.variables) == count
