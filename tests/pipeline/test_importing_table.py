"""Text tables as people write them: delimiters, headers, comments, missing values, faults with their line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from data_schemas.errors import FileError, RecordError
from pipeline.importing.table import number, read_table


@pytest.fixture
def table(tmp_path):
    def write(text):
        path = tmp_path / "t.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_table(path)

    return write


@pytest.mark.parametrize(
    "text",
    [
        "0,1.5\n0.5,2.5\n",
        "0;1.5\n0.5;2.5\n",
        "0;1,5\n0,5;2,5\n",
        "0\t1.5\n0.5\t2.5\n",
        "0\t1,5\n0,5\t2,5\n",
        "  0 1.5\n0.5   2.5\n",
        "0,0 1,5\n0,5 2,5\n",
        "0, 1.5\n0.5, 2.5\n",
        '"0","1.5"\n"0.5","2.5"\n',
        "\ufeff0,1.5\r\n0.5,2.5\r\n",
        "# a comment\n0,1.5\n\n# another\n0.5,2.5",
        "0,1.5,\n0.5,2.5,\n",
    ],
    ids=["comma", "semicolon", "decimal comma", "tab", "tab and decimal comma", "blanks",
         "blanks and decimal comma", "comma and blank", "quoted", "byte order mark", "comments", "trailing delimiter"],
)  # fmt: skip
def test_every_way_of_writing_gives_the_same_numbers(table, text):
    read = table(text)
    assert read.names == ("", "")
    assert read.numbers(0) == [0.0, 0.5]
    assert read.numbers(1) == [1.5, 2.5]


@pytest.mark.parametrize("first", ["time, angle\n", "# time, angle\n", '"time","angle"\n'])
def test_a_header_names_the_columns_also_from_a_comment(table, first):
    read = table(first + "0, 1.5\n0.5, 2.5\n")
    assert read.names == ("time", "angle")
    assert read.lines == (2, 3)


def test_a_first_row_of_a_date_or_a_missing_value_is_no_header(table):
    assert table("2024-05-01T00:00:00,-\n2024-05-01T00:00:01,2\n").names == ("", "")


@pytest.mark.parametrize("word", ["", "NaN", "nan", "-", "NA", "n/a", "null"])
def test_missing_values_become_nan(table, word):
    values = table(f"t;a\n0;1\n1;{word}\n2;3\n").numbers(1)
    assert values[0] == 1.0
    assert math.isnan(values[1])
    assert values[2] == 3.0


@pytest.mark.parametrize("cell", ["1_000", "1 0", "0x10", "ten", "1.2.3", "1,2,3", "--1"])
def test_what_is_no_number_is_no_number(cell):
    assert number(cell) is None


@pytest.mark.parametrize("word", ["inf", "-inf", "1e999", "abc"])
def test_a_value_that_is_not_finite_is_refused_with_its_line_and_column(table, word):
    with pytest.raises(RecordError, match=r"t\.csv: line 3, column 'a': .* not a finite number; correct it"):
        table(f"t,a\n0,1\n1,{word}\n").numbers(1)


def test_a_ragged_row_is_refused_with_its_line(table):
    with pytest.raises(RecordError, match=r"t\.csv: line 4 has 3 cells where the first row has 2"):
        table("t,a\n0,1\n1,2\n2,3,4\n")


@pytest.mark.parametrize("text", ["\n\n", "# only a comment\n"])
def test_an_empty_table_is_refused(table, text):
    with pytest.raises(RecordError, match=r"t\.csv: holds no rows"):
        table(text)
    with pytest.raises(FileError, match=r"t\.csv: is empty"):
        table("")


@pytest.mark.parametrize("raw", [b"\x89HDF\r\n\x1a\n\0\0", "time,angle\n".encode("utf-16"), b"0,\xff\n"])
def test_what_is_no_text_is_refused(table, raw):
    with pytest.raises(FileError, match=r"t\.csv: is not UTF-8 text; export it"):
        table(raw)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(FileError, match="is a folder"):
        read_table(tmp_path)


def test_numbers_survive_their_text(table):
    values = np.random.default_rng(1).normal(size=200)
    read = table("".join(f"{index},{float(value)!r}\n" for index, value in enumerate(values)))
    assert read.numbers(1) == values.tolist()


def test_a_table_of_very_many_columns_is_refused(tmp_path):
    """20,000 of them took 3 GB and ended in an internal error."""
    path = tmp_path / "wide.csv"
    path.write_text("\n".join([",".join(["1.0"] * 10_000)] * 3))
    with pytest.raises(RecordError, match="has 10000 columns; give times and the traces alone, 1000 at most"):
        read_table(path)
