"""Tables of any columns: what is wrong is named with file and line."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.csv_rows import table_csv
from dbbstation.files.recordings.table_csv import parse_table


def test_comments_separators_and_quotes():
    for separator in (",", ";", "\t"):
        text = f'# a\n\nx_mm{separator}run\n1.5{separator}"a b"\n# c\n2{separator}b\n'
        table = parse_table(text, "x.csv")
        assert table.names == ("x_mm", "run")
        assert table.values["x_mm"].tolist() == [1.5, 2.0]
        assert table.cells["run"] == ("a b", "b")
        assert table.lines.tolist() == [4, 6]
        assert table.is_text("run")
        assert not table.is_text("x_mm")


def test_empty_cells_say_that_there_is_no_number_and_words_do_not():
    table = parse_table("x,y\n1,2\n,NaN\nabc,inf\n", "x.csv")
    assert np.isnan(table.values["x"]).tolist() == [False, True, True]
    assert [str(fault) for fault in table.faults_of("x")] == [
        "x.csv:4: x is `abc`, not a finite number; correct the cell, or leave it empty"
    ]
    assert [fault.line for fault in table.faults_of("y")] == [4]


def test_a_column_of_decimal_commas_is_told_once():
    faults = parse_table("x;y\n1,5;2\n2,5;3\n4;5\n#NV;6\n", "x.csv").faults_of("x")
    assert list(map(str, faults)) == [
        "x.csv:1: x has decimal commas, such as `1,5`; state the decimal sign: `--decimal ,`"
    ]


def test_a_cell_that_a_spreadsheet_could_not_compute_is_an_empty_one():
    table = parse_table("y,x\n2,1\n3,#N/A\n4,#DIV/0!\n", "x.csv")
    assert table.faults_of("x") == []
    assert np.isnan(table.values["x"]).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "x.csv: the file has no columns and no rows; begin with a line of names"),
        ("# a\n", "x.csv: the file has no columns and no rows"),
        ("measured,simulated\n", "x.csv:1: there are no rows below this line"),
        ("measurd,simulated\n1,2\n", "x.csv:1: there is no column `measured`; did you mean `measurd`?"),
        ("a,simulated\n1,2\n", "x.csv:1: there is no column `measured`; columns here: a, simulated"),
        ("measured,simulated,simulated\n1,2,3\n", "x.csv:1: the column `simulated` appears here more than once"),
        ("measured,,simulated\n1,2,3\n", "x.csv:1: column 2 has no name"),
        ("measured,simulated\n1,2\n1,2,3\n", "x.csv:3: 3 values in 2 columns"),
    ],
)
def test_a_fault_is_named_with_its_line(text, said):
    with pytest.raises(InputError) as raised:
        parse_table(text, "x.csv", ("measured", "simulated"))
    assert said in str(raised.value)


def test_columns_are_written_as_they_are_read():
    text = table_csv(["run", "x_mm"], [("a,b", "c"), [1.0 / 3.0, 2.0]])
    assert text == 'run,x_mm\n"a,b",0.333333333\nc,2\n'
    table = parse_table(text, "x.csv")
    assert table.cells["run"] == ("a,b", "c")
