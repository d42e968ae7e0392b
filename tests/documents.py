"""The code blocks of README and docs, run as pasted. Run as a program it writes what ```output blocks show anew."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("README.md", *sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").glob("*.md")))

_REMARK = re.compile(r"^<!-- (not run|checked): (.+) -->$")
_SHELL = ("sh", "bash", "shell", "console")


@dataclass(frozen=True)
class Block:
    """A fenced block: where it stands, its language, and what a comment before it says of it."""

    line: int
    language: str
    text: str
    not_run: str = ""
    checked: str = ""


def blocks(text: str) -> list[Block]:
    """All fenced blocks of a page, in order."""
    found: list[Block] = []
    lines = text.splitlines()
    i, remark = 0, {"not run": "", "checked": ""}
    while i < len(lines):
        if match := _REMARK.match(lines[i]):
            remark[match[1]] = match[2]
        elif lines[i].startswith("```"):
            end = next(j for j in range(i + 1, len(lines)) if lines[j].startswith("```"))
            content = "".join(f"{line}\n" for line in lines[i + 1 : end])
            found.append(Block(i + 1, lines[i].lstrip("`"), content, remark["not run"], remark["checked"]))
            i, remark = end, {"not run": "", "checked": ""}
        elif lines[i].strip():
            remark = {"not run": "", "checked": ""}
        i += 1
    return found


def commands(block: Block) -> list[tuple[str, list[str]]]:
    """The commands of a shell block, continued lines joined, each with the lines that are shown below it."""
    found: list[tuple[str, list[str]]] = []
    prompt = "$ " if block.language == "console" else ""
    for line in block.text.replace("\\\n", " ").splitlines():
        if line.startswith(prompt) and (prompt or line.split("#")[0].strip()):
            found.append((line.removeprefix(prompt), []))
        elif prompt:
            found[-1][1].append(line)
    return found


def differs(shown: list[str], printed: list[str]) -> str:
    """What a page shows that is not printed in this order; where no ... leaves out lines, what is printed besides."""
    at = 0
    for line in shown:
        if line == "...":
            continue
        if line not in printed[at:]:
            return f"shown, but not printed (there): {line}"
        at += printed[at:].index(line) + 1
    if shown and "..." not in shown and len(shown) != len(printed):
        return f"{len(shown)} lines are shown, {len(printed)} printed: write ... for those left out"
    return ""


class Reader:
    """Somebody who pastes one block of a page after the other, in a folder that holds the repository's examples."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        (folder / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
        self._environment = {
            **os.environ,
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
            "MPLBACKEND": "Agg",
            "PYTHONWARNINGS": "error",
        }
        self.printed: list[str] = []

    def paste(self, block: Block) -> str:
        """Runs or checks a block; returns what is wrong, in words, empty where nothing is."""
        if block.not_run:
            return ""
        if block.language == "python":
            return self._run([sys.executable, "-c", block.text])
        if block.language == "output":
            return differs(block.text.splitlines(), self.printed)
        if block.language in _SHELL:
            for command, shown in commands(block):
                wrong = self._run(["bash", "-euo", "pipefail", "-c", command])
                wrong = wrong or differs(shown, self.printed) or ("" if self.printed else "printed nothing")
                if wrong:
                    return f"{command}\n{wrong}"
            return ""
        if block.checked:
            return self._check(block)
        return "neither run nor checked, and no comment says why: <!-- not run: ... -->"

    def _run(self, command: list[str]) -> str:
        out = subprocess.run(
            command, cwd=self._folder, env=self._environment, capture_output=True, text=True, check=False
        )
        self.printed = [line.rstrip() for line in out.stdout.splitlines()]
        return "" if out.returncode == 0 else f"exit status {out.returncode}\n{out.stdout}\n{out.stderr}"

    def _check(self, block: Block) -> str:
        """A file that is shown, read by what it is for."""
        path = self._folder / "shown.toml"
        path.write_text(block.text, encoding="utf-8")
        readers = {
            "configuration": "from rthstrack import read_configuration as read; read('shown.toml')",
            "layout of datagrams": "from rthstrack.live.layout import read_layout as read; read('shown.toml', 'udp')",
            "layout of lines": "from rthstrack.live.layout import read_layout as read; read('shown.toml', 'lines')",
        }
        if block.checked not in readers:
            return f"checked: expected one of {', '.join(readers)}, found {block.checked}"
        return self._run([sys.executable, "-c", readers[block.checked]])


def mistakes(text: str, folder: Path) -> list[tuple[int, str]]:
    """What is wrong on a page, by line: blocks that fail, what is shown and not printed, or printed and not shown."""
    reader = Reader(folder)
    found = blocks(text)
    wrong = []
    for block, following in zip(found, [*found[1:], None], strict=False):
        if said := reader.paste(block):
            wrong.append((block.line, said))
        elif block.language == "python" and not block.not_run and reader.printed:
            after = block.line + len(block.text.splitlines()) + 3
            if following is None or following.language != "output" or following.line != after:
                wrong.append((block.line, "prints what no ```output block below it shows"))
    return wrong


def written(page: str) -> str:
    """The page with its ```output blocks as they are printed now; those that leave out lines are left as they are."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    changes: list[tuple[int, int, list[str]]] = []
    with tempfile.TemporaryDirectory() as folder:
        reader = Reader(Path(folder))
        for block in blocks("\n".join(lines)):
            if block.language != "output":
                if wrong := reader.paste(block):
                    print(f"{page}:{block.line}: {wrong}", file=sys.stderr)
            elif "..." not in block.text.splitlines():
                changes.append((block.line, block.line + len(block.text.splitlines()), reader.printed))
    for first, end, printed in reversed(changes):
        lines[first:end] = printed
    return "".join(f"{line}\n" for line in lines)


if __name__ == "__main__":
    for page in sys.argv[1:] or PAGES:
        (ROOT / page).write_text(written(page), encoding="utf-8")
