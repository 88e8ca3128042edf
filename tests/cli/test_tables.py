"""Rows for people and for programs."""

from __future__ import annotations

import json

import numpy as np

from pipeline.cli.tables import Printable, complain, plain, print_json, print_table, text


def test_json_rows_are_one_line_with_null_for_what_is_not_finite(capsys):
    print_json({"a": np.float64("nan"), "b": np.array([1.0, np.inf]), "c": np.int64(3), "d": {1: ("ä", True)}})
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert "ä" in out
    assert json.loads(out) == {"a": None, "b": [1.0, None], "c": 3, "d": {"1": ["ä", True]}}


def test_numbers_survive_json_to_the_last_bit(capsys):
    value = 9.805432100000001
    print_json({"gravity": np.float64(value)})
    assert json.loads(capsys.readouterr().out)["gravity"] == value


def test_a_table_is_as_wide_as_its_cells_and_numbers_stand_right(capsys):
    print_table(
        [
            {"case": "linear", "error": 0.001},
            {"case": "beats-through-zero", "error": -12.3456, "note": "flag"},
        ]
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "case                 error  note"
    assert lines[1] == "linear               0.001  -"
    assert lines[2] == "beats-through-zero  -12.35  flag"


def test_an_empty_table_prints_nothing(capsys):
    print_table([])
    assert capsys.readouterr().out == ""


def test_cells():
    assert [text(value) for value in (None, float("nan"), True, np.float64(2.5), 7, "x")] == [
        "-", "-", "yes", "2.5", "7", "x",
    ]  # fmt: skip
    assert plain([np.bool_(True)]) == [True]


def test_nothing_from_a_file_commands_the_terminal(capsys):
    import contextlib
    import sys

    evil = "a\x1b[2Jb\x9bc\u202ed\r"
    with contextlib.redirect_stdout(Printable(sys.stdout)):
        print(f"{evil}\n\tä")
    complain(evil)
    print_json({"label": evil})
    shown = capsys.readouterr()
    assert shown.out.splitlines()[0] == "a?[2Jb?c?d?"
    assert shown.out.splitlines()[1] == "\tä"
    assert json.loads(shown.out.splitlines()[2]) == {"label": evil}
    assert all(each.isprintable() or each in "\n\t" for each in shown.out + shown.err)
