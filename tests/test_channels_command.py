"""`rthstrack channels`: what it prints, as a table and as JSON, and its exit status."""

from __future__ import annotations

import argparse
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rthstrack.cli import channels, main
from rthstrack.errors import RecordingError
from rthstrack.studies.pairs import read_pairs

if TYPE_CHECKING:
    from pathlib import Path


def run(*arguments: object) -> int:
    parser = argparse.ArgumentParser()
    channels.add_parser(parser.add_subparsers(required=True))
    args = parser.parse_args(["channels", *map(str, arguments)])
    status = args.run(args)
    assert isinstance(status, int)
    return status


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "run 1.csv"
    rows = "".join(f"{i * 0.01:.2f},{i % 5},{'' if i == 3 else i % 7},word\n" for i in range(20))
    path.write_text(f"t_s,cmd_mm,meas_mm,remark\n{rows}")
    return path


def test_the_table_shows_channels_rate_pair_and_notes(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(file) == 0
    assert (
        capsys.readouterr().out
        == f"""\
{file}: text, comma between columns
      channel  unit  samples  min   max  NaN
  #0  t_s      s          20    0  0.19    0
  #1  cmd_mm   mm         20    0     4    0
  #2  meas_mm  mm         20    0     6    1
  rate: 100 Hz, from time column 't_s'
  likely pair: --target 'cmd_mm' --measured 'meas_mm' ('cmd_mm' and 'meas_mm' are named like target and measured)
  note: 'remark' holds text in 20 lines, no channel
"""
    )


def test_json_holds_the_same_with_full_precision(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(file, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert found["failures"] == []
    (listing,) = found["files"]
    assert listing["file"] == str(file)
    assert listing["rate_hz"] == 100.0
    assert listing["channels"][2] == {
        "index": 2,
        "name": "meas_mm",
        "path": "meas_mm",
        "unit": "mm",
        "n_samples": 20,
        "min": 0.0,
        "max": 6.0,
        "n_nan": 1,
        "n_infinite": 0,
    }
    assert listing["proposed"] == [{"actuator_number": 1, "target": "cmd_mm", "measured": "meas_mm"}]


def test_a_file_that_cannot_be_read_does_not_stop_the_others(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path / "none.csv", file) == 1
    out, err = capsys.readouterr()
    assert "meas_mm" in out
    assert err == f"rthstrack: {tmp_path / 'none.csv'}: no such file\n"
    assert run(tmp_path / "none.csv", file, "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert [listing["file"] for listing in found["files"]] == [str(file)]
    assert found["failures"] == [
        {"file": str(tmp_path / "none.csv"), "error": f"{tmp_path / 'none.csv'}: no such file"}
    ]


def test_channels_are_listed_where_the_rate_cannot_be_settled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "file.csv"
    path.write_text("t,inf\n0,1\n0.1,inf\n0.1,nan\n0.2,inf\n")
    assert run(path) == 0
    out = capsys.readouterr().out
    assert ["#1", "inf", "-", "4", "1", "1", "1", "(+2", "inf)"] in [line.split() for line in out.splitlines()]
    assert "rate: not known: time column 't' is not uniform: 1 repeat(s) among 3 steps" in out


def test_no_file_is_misuse(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        run()
    assert stopped.value.code == 2
    assert "the following arguments are required: FILE" in capsys.readouterr().err


def test_the_listing_of_every_shared_record(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = sorted(p for p in (shared / "records").iterdir() if p.suffix in (".mat", ".csv") or "_" in p.stem)
    assert run(*files, *(shared / "reference").glob("*.npz"), "--json") == 0
    rates = {
        listing["file"].rpartition("/")[2]: listing["rate_hz"]
        for listing in json.loads(capsys.readouterr().out)["files"]
    }
    assert rates == {
        "ElCentroAccelNoScaling.mat": 50.0,
        "KobeAccelNoScaling.mat": 100.0,
        "MauleAccelNoScaling.mat": 200.0,
        "northridge_canoga_park.txt": None,
        "utfsm_15Hz_0A.txt": 1000.0,
        "utfsm_chirp_0A.csv": 1000.0,
        "chy101n_boucwen.npz": 1024.0,
        "chy101n_linear.npz": 1024.0,
    }


def test_advice_speaks_of_arguments_in_the_library_and_of_options_in_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "{time}.csv"
    file.write_text("a,b\n1.5,2\n3,4\n2,8\n")
    with pytest.raises(RecordingError) as caught:
        read_pairs(file)
    assert str(caught.value).startswith(f"{file}: no sampling rate: ")
    assert str(caught.value).endswith("; give rate_hz or time")
    assert main(["evaluate", str(file)]) == 1
    assert f"{file}: no sampling rate: " in (err := capsys.readouterr().err)
    assert err.endswith("; give --rate HZ or --time CHANNEL\n")


def test_a_channel_that_ends_with_nothing_says_where_to_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = np.sin(np.arange(300) / 20)
    rows = [f"{i / 100:.2f},{v:.4f},{0.97 * v if i <= 280 else math.nan:.4f}\n" for i, v in enumerate(values)]
    file = tmp_path / "run.csv"
    file.write_text("t,target,measured\n" + "".join(rows).replace("nan", ""))
    assert main(["evaluate", str(file), "--fill", "3"]) == 1
    err = capsys.readouterr().err
    assert "19 sample(s) at the end; cut there: --end S = 2.81 s" in err
    assert main(["evaluate", str(file), "--end", "2.81"]) == 0
