"""Cells and tables say what they are given."""

from __future__ import annotations

import json

import pandas as pd

from experiments.results_files import rows_of
from experiments.show.tables import in_percent, in_unit, markdown_table

FOUND = {"value": 0.8364, "low": 0.5, "high": 1.0, "more": 3.0}


def test_a_figure_has_its_interval_and_unit_beside_it() -> None:
    assert in_unit(FOUND) == "0.84 [0.50, 1.00]"
    assert in_unit(FOUND, "m", ".1e") == "8.4e-01 [5.0e-01, 1.0e+00] m"
    assert in_percent(FOUND) == "83.6 [50.0, 100.0]"
    assert in_percent(FOUND, "%") == "83.6 [50.0, 100.0] %"
    assert in_unit(None, "m") == in_percent(None, "%") == ""


def test_a_table_has_a_line_a_row_and_blank_cells_where_there_is_none() -> None:
    lines = markdown_table((None, "a"), [("b", "1"), ("c", ""), ("d", None)]).splitlines()
    assert lines == ["| | a |", "|---|---|", "| b | 1 |", "| c |  |", "| d | |"]
    assert markdown_table(("a", "b"), [], rule=" --- ").splitlines()[1] == "| --- | --- |"


def test_missing_values_of_a_table_are_null_in_its_rows() -> None:
    table = pd.DataFrame({"model": ["a", "b"], "speed": pd.array([1.5, None], "Float64"), "count": [3, 0]})
    rows = rows_of(table)
    assert rows == [{"model": "a", "speed": 1.5, "count": 3}, {"model": "b", "speed": None, "count": 0}]
    assert json.loads(json.dumps(rows)) == rows
