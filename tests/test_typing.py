"""`mypy --strict` over what users write: the Python of README and docs, and a script."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import rthstrack

TESTS = Path(__file__).parent
PAGES = (TESTS.parent / "README.md", *sorted((TESTS.parent / "docs").glob("*.md")))


def complaints(folder: Path, *files: Path) -> list[str]:
    """The lines of mypy's errors, as a user sees them: without a configuration."""
    run = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--no-error-summary", *map(str, files)],
        cwd=folder,
        env={**os.environ, "MYPYPATH": str(Path(rthstrack.__file__).parent.parent)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.stderr == ""
    return [line for line in run.stdout.splitlines() if ": error: " in line]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("typed")


def test_the_python_of_readme_and_docs_and_a_script_pass(folder: Path) -> None:
    files = [TESTS / "user_script.py"]
    for page in PAGES:
        blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        for i, block in enumerate(blocks):
            files.append(folder / f"{page.stem.replace('-', '_')}_{i}.py")
            files[-1].write_text(block, encoding="utf-8")
    assert len(files) > 5
    found = complaints(folder, *files)
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "line",
    [
        "rthstrack.evaluation_of",
        "rthstrack.assess(recording, target=3)",
        "rthstrack.assess(signal, signal)",
        "rthstrack.evaluate(signal, signal, recording.rate_hz)",  # it may be None
        "rthstrack.evaluate(signal, signal, 1024, windw='hann')",
        "rthstrack.evaluate(signal, signal, 1024).delay_s[0]",
        "rthstrack.write_report(3, 'report.html')",
    ],
)
def test_a_mistake_is_seen(folder: Path, line: str) -> None:
    path = folder / "mistaken.py"
    start = "import numpy as np\nimport rthstrack\n\nsignal = np.zeros(9)\nrecording = rthstrack.read_recording('a')\n"
    path.write_text(f"{start}{line}\n", encoding="utf-8")
    first, *_ = complaints(folder, path)
    assert first.startswith("mistaken.py:6: error: ")
