"""Small files rebuilt from the field, each with its right value or its reason (../shared/cases/README.md)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rthstrack.cli import main
from tolerances import physical

#: File, true delay in ms; the true gain is 0.970. What the numbers are read to: 0.05 ms.
RIGHT = {
    "two_time_columns.csv": 62.0,
    "tdms_start_offset.tdms": 62.0,
    "struct_time_by_majority.mat": 12.0,
    "unit_row_with_unknown_unit.csv": 12.0,
    "chinese_header.csv": 12.0,
    "copied_demand_column.csv": 12.0,
    "time_in_ms_no_header.txt": 12.0,
    "mts793_two_blocks.dat": 12.0,
    "statistics_footer.csv": 12.0,
    "truncated_last_line.csv": 12.0,
    "command_named_measured_not.csv": 12.0,
    "units_mm_and_m.csv": 12.0,
    "offset_on_measured.csv": 12.0,
    "measured_held_5_samples.csv": 12.0,
    "two_spikes.csv": 12.0,
    "table_v7.mat": 12.0,
}


def judged(shared: Path, name: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    file = shared / "cases" / name
    if not file.is_file():
        pytest.skip("the cases are not there")
    status = main(["evaluate", str(file), "--json"])
    return status, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("name", RIGHT)
def test_a_file_of_the_field_gives_its_right_value(shared: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    if name == "table_v7.mat":
        pytest.importorskip("matio")
    status, document = judged(shared, name, capsys)
    assert status == 0
    (result,) = document["results"]
    assert result["trusted"]["delay_s"] == pytest.approx(1e-3 * RIGHT[name], abs=physical(0.05, "ms"))
    assert result["trusted"]["amplitude"] == pytest.approx(0.970, abs=physical(2e-4, "relative"))


def test_what_was_done_to_a_file_is_said(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = {
        "two_time_columns.csv": "one_clock",
        "tdms_start_offset.tdms": "one_clock",
        "units_mm_and_m.csv": "converted",
        "statistics_footer.csv": None,
        "truncated_last_line.csv": None,
        "mts793_two_blocks.dat": None,
    }
    for name, code in said.items():
        _, document = judged(shared, name, capsys)
        codes = {one["code"] for one in document["results"][0]["warning_codes"]}
        assert codes, name
        assert code is None or code in codes, (name, codes)


def test_a_pointer_to_a_file_is_named(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, document = judged(shared, "git_lfs_pointer.mat", capsys)
    assert status == 1
    assert "Git LFS pointer" in document["failures"][0]["error"]
