import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.report import format_table


def test_numbers_are_aligned_right_and_words_left():
    rows = [["claw", 16608, 0.614159, True], ["truss | finger", np.int64(42), np.float64(1234567.0), np.bool_(False)]]
    assert format_table(["demo", "DOFs", "seconds", "stable"], rows, digits=3).splitlines() == [
        "| demo            |  DOFs |  seconds | stable |",
        "| --------------- | ----: | -------: | ------ |",
        "| claw            | 16608 |    0.614 | yes    |",
        "| truss \\| finger |    42 | 1.23e+06 | no     |",
    ]


def test_unknown_values_keep_a_column_of_numbers_right():
    lines = format_table(["h"], [[None], [2.5]]).splitlines()
    assert lines[1:] == ["| --: |", "|   – |", "| 2.5 |"]


def test_a_table_without_rows_has_its_headers():
    assert format_table(["a", "long name"], []).splitlines() == ["| a   | long name |", "| --- | --------- |"]


def test_a_row_of_another_length_is_named():
    with pytest.raises(DescriptionError, match="row 1 of the table: 1 cell for 2 columns"):
        format_table(["a", "b"], [[1, 2], [3]])
