"""What every command does with a mistake in the command line, with 80 columns, and with a reader that goes away."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rthstrack.cli import main
from rthstrack.cli.commands import COMMANDS

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "examples" / "data" / "utfsm_chirp_0A.csv"
SIMULATED = ROOT / "examples" / "actuator_alone.toml"
ENVIRONMENT = {**os.environ, "COLUMNS": "80", "MPLBACKEND": "Agg"}
EVERY = ("", *COMMANDS)


def misused(capsys: pytest.CaptureFixture[str], *words: str) -> list[str]:
    """The lines on standard error of a command line that is refused; nothing else is printed."""
    try:
        status = main(list(words))
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    assert status == 2, err
    assert out == ""
    return err.splitlines()


@pytest.mark.parametrize("command", EVERY)
def test_a_mistake_comes_first_and_a_short_usage_after(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = [command] if command else []
    first, *rest = misused(capsys, *words, "--xyzzy")
    assert first.endswith("error: there is no option --xyzzy")
    name = " ".join(["rthstrack", *words])
    assert first.startswith(f"{name}: ")
    assert len(rest) == 2
    assert rest[0].startswith(f"usage: {name} ")
    assert rest[1] == f"{name} --help tells more"
    assert all(len(line) <= 80 for line in rest)


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "monitor"])
def test_what_is_missing_is_named_and_in_the_usage(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    first, usage, _ = misused(capsys, command)
    missing = first.rpartition(": ")[2].split(", ")
    assert all(one.split("/")[0] in usage for one in missing)


def test_mistakes_that_are_told_at_once_come_before_the_usage_too(capsys: pytest.CaptureFixture[str]) -> None:
    *mistakes, usage, _ = misused(capsys, "monitor", "--window", "x")
    assert len(mistakes) == 3
    assert "--window: expected" in "\n".join(mistakes)
    assert usage == "usage: rthstrack monitor --listen udp://HOST:PORT|- --rate HZ [options]"


def test_a_mistake_in_a_file_is_no_matter_of_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "odd.toml"
    path.write_text("[structure]\n", encoding="utf-8")
    assert not any("usage" in line for line in misused(capsys, "simulate", str(path)))


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["evalute"], "'evaluate'"),
        (["Evaluate", "x"], "'evaluate'"),
        (["chanels", "x"], "'channels'"),
        (["evaluate", "x.csv", "--tagret", "a"], "'--target'"),
        (["evaluate", "x.csv", "--limit-dealy=0.02"], "'--limit-delay'"),
        (["evaluate", "x.csv", "-p", "16"], "'-P'"),
        (["evaluate", "x.csv", "--preset", "papper"], "'paper'"),
        (["evaluate", "x.csv", "--estimator", "least_sqares"], "'least_squares'"),
        (["replay", "x.csv", "--too", "udp://127.0.0.1:1"], "'--to'"),
        (["monitor", "--lisen", "-"], "'--listen'"),
        (["simulate", "x.toml", "--sed", "1"], "'--seed'"),
        (["reproduce", "--outptu", "x"], "'--output'"),
        (["channels", "x", "--jsn"], "'--json'"),
        (["--verson"], "'--version'"),
    ],
)
def test_what_was_meant_is_asked(words: list[str], meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    first = misused(capsys, *words)[0]
    assert "(did you mean " in first
    assert meant in first


@pytest.mark.parametrize("value", ["-1e-3", "-.5", "-0.012"])
def test_a_negative_number_is_a_value(value: str, capsys: pytest.CaptureFixture[str]) -> None:
    first = misused(capsys, "study", "x.csv", "--true-delay", value, "-P", "3")[0]
    assert first == "rthstrack: P must hold powers of two (1, 2, 4, ...), found 3"


@pytest.mark.parametrize("command", EVERY)
def test_help_fits_80_columns(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as stopped:
        main([*([command] if command else []), "--help"])
    assert stopped.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if len(line) > 80] == []
    assert lines[0].startswith(f"usage: {' '.join(['rthstrack', command]).strip()} ")
    assert lines[1] == ""


# A reader that goes away ----------------------------------------------------------------------------------------------

PRINTING = {
    "evaluate": [str(EXAMPLE)],
    "evaluate --json": [str(EXAMPLE), "--json"],
    "evaluate several": [str(EXAMPLE), str(EXAMPLE)],
    "channels": [str(EXAMPLE)],
    "channels --json": [str(EXAMPLE), "--json"],
    "simulate": [str(SIMULATED)],
    "study": [str(EXAMPLE), "-P", "1,2", "-Q", "1", "--no-timing"],
    "study --json": [str(EXAMPLE), "-P", "1,2", "-Q", "1", "--no-timing", "--json"],
    "monitor": ["--listen", "-", "--rate", "100", "--quiet"],
    **{f"{name} --help".strip(): ["--help"] for name in EVERY},
    "--version": [],
}


@pytest.mark.parametrize("name", PRINTING)
def test_a_reader_that_has_had_enough_is_no_error(name: str) -> None:
    words = [word for word in name.split()[:1] if word != "--help"]
    read, write = os.pipe()
    os.close(read)
    try:
        run = subprocess.run(
            [sys.executable, "-m", "rthstrack", *words, *PRINTING[name]],
            stdin=subprocess.DEVNULL, stdout=write, stderr=subprocess.PIPE, env=ENVIRONMENT, text=True, check=False,
        )  # fmt: skip
    finally:
        os.close(write)
    # argparse keeps to itself that nobody reads its help.
    assert run.returncode in ((0, 141) if name.startswith("--") or "--help" in name else (141,)), run.stderr
    if words != ["monitor"]:
        assert run.stderr == ""
    # The monitor says what it saw, as without a pipe.
    assert "Error" not in run.stderr
    assert "Broken pipe" not in run.stderr


@pytest.mark.parametrize("name", ["evaluate", "study", "channels --json"])
def test_the_first_line_can_be_taken(name: str) -> None:
    command = " ".join([sys.executable, "-m rthstrack", *name.split()[:1], *PRINTING[name]])
    run = subprocess.run(
        ["bash", "-c", f"{command} | head -1; exit ${{PIPESTATUS[0]}}"],
        env=ENVIRONMENT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode in (0, 141)
    assert run.stderr == ""
    assert len(run.stdout.splitlines()) == 1


def test_an_interrupt_is_a_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("rthstrack.cli.channels.run", interrupted)
    assert main(["channels", str(EXAMPLE)]) == 130
    out, err = capsys.readouterr()
    assert (out, err) == ("", "rthstrack: interrupted\n")
