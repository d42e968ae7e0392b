"""The README's Python and commands, and those of pages of docs, run as pasted: in order, in an empty folder a page."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGES = ("README.md", "docs/estimators.md", "docs/limits.md", "docs/online.md")

# What a reader does once, before anything can be pasted; `make test` and test_install.py try these.
SETTING_UP = ("pip ", "python -m pip", "git ", "make", "cargo ", "cd ", "apt")


def _blocks(text: str) -> list[tuple[str, str]]:
    """Language and text of every fenced block, in order."""
    return [(m[1], m[2]) for m in re.finditer(r"^```(\w+)[^\n]*\n(.*?)^```$", text, flags=re.M | re.S)]


def _commands(block: str) -> list[str]:
    """The command lines of a shell block: without prompts, comments, output and setting up; continued lines joined."""
    lines = block.replace("\\\n", " ").splitlines()
    if any(line.startswith("$ ") for line in lines):
        lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
    commands = [line.split("  #")[0].strip() for line in lines]
    return [c for c in commands if c and not c.startswith(("#", *SETTING_UP))]


@pytest.fixture(scope="module", params=PAGES)
def pasted(
    request: pytest.FixtureRequest, root: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, list[str]]:
    """Runs every block of a page; what was run, by language. Only the repository's examples are within reach."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "examples").symlink_to(root / "examples", target_is_directory=True)
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "MPLBACKEND": "Agg",
        "PYTHONWARNINGS": "error",
    }
    done: dict[str, list[str]] = {"python": [], "shell": []}
    for language, block in _blocks((root / request.param).read_text(encoding="utf-8")):
        if language == "python":
            runs = [("python", block, [sys.executable, "-c", block])]
        elif language in ("sh", "bash", "shell", "console"):
            runs = [("shell", c, ["bash", "-euo", "pipefail", "-c", c]) for c in _commands(block)]
        else:
            continue
        printed: list[str] = []
        for kind, source, command in runs:
            out = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
            assert out.returncode == 0, f"{source}\n{out.stdout}\n{out.stderr}"
            assert out.stdout or kind == "python", f"{source}\nprinted nothing"
            printed += [line.rstrip() for line in out.stdout.splitlines()]
            done[kind].append(source)
        if language == "console":
            shown = [line for line in block.splitlines() if not line.startswith("$ ") and line != "..."]
            assert [line for line in shown if line not in printed] == [], "the page shows what is not printed"
    return done


def test_the_readmes_python_runs_as_pasted(pasted: dict[str, list[str]]) -> None:
    assert any("rthstrack" in block for block in pasted["python"])


def test_the_readmes_commands_run_as_pasted(pasted: dict[str, list[str]]) -> None:
    assert any(command.startswith(("rthstrack evaluate", "rthstrack monitor")) for command in pasted["shell"])


@pytest.mark.parametrize("page", PAGES)
def test_what_the_page_shows_and_links_to_is_there(root: Path, page: str) -> None:
    text = (root / page).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#\s]+)\)|(?:src|href)=\"([^\"#]+)\"", text)
    local = [a or b for a, b in links if "://" not in (a or b)]
    assert local, "the page shows no picture and links to nothing in the repository"
    assert [link for link in local if not ((root / page).parent / link).exists()] == []


def test_the_glossary_has_the_words_that_are_printed(root: Path) -> None:
    from rthstrack.verdict import display, limits, warnings

    glossary = (root / "docs/glossary.md").read_text(encoding="utf-8")
    words = [name for name, *_ in display.INDICES]
    words += [*display.ESTIMATORS, *display.ESTIMATORS.values(), *limits._CONCLUSIONS, *limits._CONCLUSIONS.values()]
    words += [*warnings._BAD_WORDS, "held"]
    assert [word for word in words if word not in glossary] == []
