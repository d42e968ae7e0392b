"""What a user does first: build a wheel, install it into an empty environment, run the command."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rthstrack
from tolerances import physical


def _environment(root: Path) -> dict[str, str]:
    """The caller's, less what would let the new environment see this one; the build's own tools pinned too."""
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")}
    pins = str(root / "constraints.txt")
    return {
        **kept,
        "PIP_CONSTRAINT": pins,
        "PIP_BUILD_CONSTRAINT": pins,
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        "PIP_NO_COMPILE": "1",
    }


def _run(*command: str | Path, cwd: Path, root: Path) -> str:
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=_environment(root), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(root: Path, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    folder = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "pip", "wheel", ".", "--quiet", "--no-deps", "-w", folder, cwd=root, root=root)
    (built,) = folder.glob("rthstrack-*.whl")
    return zipfile.ZipFile(built)


@pytest.fixture(scope="module")
def installed(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The bin folder of a new environment into which `pip install .` put rthstrack and what it needs, nothing else."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=True)
    bin_folder = folder / "bin"
    _run(
        bin_folder / "python",
        "-m",
        "pip",
        "install",
        "--quiet",
        "-c",
        root / "constraints.txt",
        ".",
        cwd=root,
        root=root,
    )
    yield bin_folder
    shutil.rmtree(folder)  # half a gigabyte


def test_the_wheel_holds_the_package_its_types_and_its_assets(wheel: zipfile.ZipFile, root: Path) -> None:
    names = set(wheel.namelist())
    package = root / "python" / "rthstrack"
    kept = {".py", ".pyi", ".js", ".css", ".html", ".typed", ".LICENSE"}
    expected = {
        path.relative_to(package.parent).as_posix()
        for path in package.rglob("*")
        if path.is_file() and (path.suffix in kept or path.name == "py.typed" or path.parent.name == "assets")
    }
    assert {"rthstrack/py.typed", "rthstrack/_core.pyi", "rthstrack/__init__.py"} <= expected
    assert any(name.startswith("rthstrack/assets/") for name in expected)
    assert expected - names == set()
    compiled = [name for name in names if name.startswith("rthstrack/_core.") and name.endswith((".so", ".pyd"))]
    assert len(compiled) == 1
    assert [name for name in names if not name.startswith("rthstrack") or name.endswith(".pyc")] == []
    # One wheel for every Python from 3.11 on.
    assert wheel.filename is not None
    assert "cp311-abi3" in wheel.filename


def test_the_wheel_says_what_it_is(wheel: zipfile.ZipFile) -> None:
    (name,) = (n for n in wheel.namelist() if n.endswith(".dist-info/METADATA"))
    metadata = wheel.read(name).decode()
    assert "License-Expression: MIT OR Apache-2.0" in metadata
    assert "Requires-Python: >=3.11" in metadata
    licences = {n.rsplit("/", 1)[1] for n in wheel.namelist() if "/licenses/" in n}
    assert {"LICENSE-MIT", "LICENSE-APACHE"} <= licences


def test_pip_install_gives_a_working_command(installed: Path, root: Path, tmp_path: Path) -> None:
    command = installed / "rthstrack"
    assert rthstrack.__version__ in _run(command, "--version", cwd=tmp_path, root=root)

    t = np.arange(2000) / 500.0
    swing = np.exp(-(((t - 2) / 0.7) ** 2))
    late = np.exp(-(((t - 0.01 - 2) / 0.7) ** 2))
    target, measured = swing * np.sin(6 * np.pi * t), 0.9 * late * np.sin(6 * np.pi * (t - 0.01))
    columns = np.column_stack([t, target, measured])
    np.savetxt(tmp_path / "test.csv", columns, fmt="%.9f", delimiter=",", header="time_s,wanted,got", comments="")
    found = json.loads(
        _run(
            *(command, "evaluate", "test.csv", "--target", "wanted", "--measured", "got", "--json"),
            cwd=tmp_path,
            root=root,
        )
    )
    (result,) = found["results"]
    assert found["failures"] == []
    assert_allclose(result["delay_s"], 0.01, rtol=physical(0.1, "%"))
    assert_allclose(result["amplitude"], 0.9, rtol=physical(0.1, "%"))
    assert result["rate_hz"] == 500.0


def test_the_installed_package_brings_its_own_files_and_no_test_tools(
    installed: Path, root: Path, tmp_path: Path
) -> None:
    script = (
        "import importlib.util as u, pathlib, rthstrack; folder = pathlib.Path(rthstrack.__file__).parent; "
        "print(folder); print((folder / 'py.typed').is_file(), any((folder / 'assets').iterdir())); "
        "print([m for m in ('pytest', 'hypothesis', 'playwright', 'maturin', 'mypy', 'pandas') if u.find_spec(m)])"
    )
    folder, files, tools = _run(installed / "python", "-c", script, cwd=tmp_path, root=root).splitlines()
    assert Path(folder).is_relative_to(installed.parent)
    assert files == "True True"
    assert tools == "[]"
