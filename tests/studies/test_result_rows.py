"""Rows of a study are in their file as soon as they are computed."""

import pytest

from faultgouge.pywrap import SceneError
from faultgouge.studies.result_rows import append_row, read_keyed_rows
from research.tables import read_rows


def test_rows_come_back_from_a_folder_that_was_not_there_without_a_line_that_a_kill_has_cut(tmp_path):
    table, rows = (
        tmp_path / "new" / "folder" / "rows.jsonl",
        [{"seed": 1, "value": 0.1 + 0.2}, {"seed": 2, "value": None}],
    )
    for row in rows:
        append_row(table, row)
    assert read_rows(table) == rows
    with table.open("a") as file:
        file.write('{"seed": 3, "va')
    assert read_keyed_rows(table, ("seed",), "a test") == rows
    append_row(table, {"other": 3})
    with pytest.raises(SceneError, match="line 3 is no result of a test"):
        read_keyed_rows(table, ("seed",), "a test")
