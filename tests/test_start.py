"""What starting the command, or importing the package, brings along: nothing that was not asked for."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import rthstrack

EXAMPLE = Path(__file__).parent.parent / "examples" / "data" / "utfsm_chirp_0A.csv"
HEAVY = ("h5py", "matplotlib", "nptdms", "pandas", "pyarrow", "scipy")


def loaded(*arguments: str) -> set[str]:
    """The packages that one run of the command has loaded when it ends."""
    code = (
        "import sys\n"
        "from rthstrack.cli import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "print('LOADED', *{name.partition('.')[0] for name in sys.modules})"
    )
    run = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    return set(run.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_version_and_help_load_no_numerics(option: str) -> None:
    assert not loaded(option) & {*HEAVY, "numpy", "rich"}


def test_a_csv_is_evaluated_without_scipy_figures_and_readers_of_other_formats() -> None:
    assert not loaded("evaluate", str(EXAMPLE)) & set(HEAVY)
    assert not loaded("evaluate", str(EXAMPLE), "--json") & set(HEAVY)


def test_a_csv_is_evaluated_without_what_its_verdict_does_not_need() -> None:
    code = (
        "import sys\nfrom rthstrack.cli import main\nmain(sys.argv[1:])\n"
        "print('LOADED', *(name for name in sys.argv.pop().split() if name in sys.modules))"
    )
    spared = (
        "rich",
        "numpy.ma",
        "difflib",
        "html",
        "json",
        "zipfile",
        "rthstrack.evaluation.factors",
        "rthstrack.recording.readers.at2",
    )
    code = code.replace("sys.argv.pop()", repr(" ".join(spared)))
    run = subprocess.run(
        [sys.executable, "-c", code, "evaluate", str(EXAMPLE)], check=True, capture_output=True, text=True
    )
    assert run.stdout.splitlines()[-1] == "LOADED"


def test_importing_the_package_loads_nothing_until_a_name_is_used() -> None:
    code = (
        "import sys, rthstrack\nfirst = 'numpy' in sys.modules\n"
        "rthstrack.evaluate\nprint(first, 'numpy' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout.split() == ["False", "True"]


def test_every_room_is_there_after_importing_the_package_alone() -> None:
    code = "import rthstrack\nprint(*[getattr(rthstrack, room).__name__ for room in rthstrack._ROOMS])"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout.split() == [f"rthstrack.{room}" for room in rthstrack._ROOMS]


def test_every_public_name_is_there_and_listed() -> None:
    assert set(rthstrack.__all__) <= set(dir(rthstrack))
    for name in rthstrack.__all__:
        assert getattr(rthstrack, name) is not None
    with pytest.raises(AttributeError, match=r"module 'rthstrack' has no attribute 'evaluation_of'"):
        _ = rthstrack.evaluation_of  # type: ignore[attr-defined]


def test_type_checkers_see_the_names_that_there_are() -> None:
    tree = ast.parse(Path(rthstrack.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.name: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }
    rooms = {name for name, module in seen.items() if module == "rthstrack"}
    assert {name: module for name, module in seen.items() if name not in rooms} == rthstrack._HOME
    assert rooms == set(rthstrack._ROOMS)
