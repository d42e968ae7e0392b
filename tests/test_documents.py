"""Every code block of README and docs runs as pasted, and prints what is shown; or a comment there says why not."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from documents import PAGES, Block, Reader, blocks, commands, differs, mistakes

# Pages that `make` writes, which hold no code.
WITH_CODE = ("README.md", "docs/estimators.md", "docs/limits.md", "docs/online.md", "docs/python.md",
             "docs/reproduction.md", "docs/virtual-tests.md")  # fmt: skip


@pytest.mark.parametrize("page", PAGES)
def test_every_block_runs_and_prints_what_is_shown(page: str, root: Path, tmp_path: Path) -> None:
    text = (root / page).read_text(encoding="utf-8")
    assert bool(blocks(text)) == (page in WITH_CODE)
    wrong = mistakes(text, tmp_path)
    assert not wrong, "\n".join(f"{page}:{line}: {said}" for line, said in wrong)


def test_the_readme_shows_python_and_commands(root: Path) -> None:
    found = blocks((root / "README.md").read_text(encoding="utf-8"))
    assert any("rthstrack.evaluate" in block.text for block in found if block.language == "python")
    typed = [command for block in found if block.language == "console" for command, _ in commands(block)]
    assert any(command.startswith("rthstrack evaluate") for command in typed)


@pytest.mark.parametrize("page", WITH_CODE)
def test_what_the_page_shows_and_links_to_is_there(root: Path, page: str) -> None:
    text = (root / page).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#\s]+)\)|(?:src|href)=\"([^\"#]+)\"", text)
    local = [a or b for a, b in links if "://" not in (a or b)]
    assert local or page != "README.md", "the README shows no picture and links to nothing in the repository"
    assert [link for link in local if not ((root / page).parent / link).exists()] == []


def test_a_page_is_read_as_it_is_written(tmp_path: Path) -> None:
    page = """\
<!-- not run: it takes a day -->
```sh
make day
```

```console
$ printf '%s\\n' \\
    one two
one
...
```
<!-- checked: configuration -->

```toml
[tset]
```
"""
    sh, console, toml = blocks(page)
    assert (sh.line, sh.language, sh.not_run) == (2, "sh", "it takes a day")
    assert [shown for _, shown in commands(console)] == [["one", "..."]]
    assert toml.checked == "configuration"
    reader = Reader(tmp_path)
    assert reader.paste(sh) == reader.paste(console) == ""
    assert "tset" in reader.paste(toml)
    # What follows a remark is none of its business.
    (other,) = blocks("<!-- not run: slow -->\ntext\n```sh\nls\n```\n")
    assert other.not_run == ""


@pytest.mark.parametrize(
    ("block", "said"),
    [
        (Block(1, "python", "print(1 / 0)\n"), "ZeroDivisionError"),
        (Block(1, "console", "$ echo 3.4\n3.5\n"), "shown, but not printed (there): 3.5"),
        (Block(1, "console", "$ printf '1\\n2\\n'\n2\n1\n"), "shown, but not printed (there): 1"),
        (Block(1, "console", "$ printf '1\\n2\\n'\n1\n"), "1 lines are shown, 2 printed"),
        (Block(1, "sh", "false\n"), "exit status 1"),
        (Block(1, "sh", "true  # quietly\n"), "printed nothing"),
        (Block(1, "c", "int i;\n"), "no comment says why"),
        (Block(1, "", "text\n"), "no comment says why"),
    ],
)
def test_what_is_wrong_is_told(block: Block, said: str, tmp_path: Path) -> None:
    assert said in Reader(tmp_path).paste(block)


def test_what_python_prints_is_compared(tmp_path: Path) -> None:
    reader = Reader(tmp_path)
    assert reader.paste(Block(1, "python", "print('d = 12.00 ms')\nprint('A = 1')\n")) == ""
    assert reader.paste(Block(5, "output", "d = 12.00 ms\nA = 1\n")) == ""
    assert "d = 12.01 ms" in reader.paste(Block(5, "output", "d = 12.01 ms\nA = 1\n"))
    assert differs(["d = 12.00 ms", "..."], reader.printed) == ""


def test_what_python_prints_is_shown(tmp_path: Path) -> None:
    page = "```python\nprint('12.00 ms')\n```\n"
    for i, (rest, n) in enumerate([("", 1), ("\n```output\n12.00 ms\n```\n", 0), ("\n```output\n...\n```\n", 0)]):
        folder = tmp_path / str(i)
        folder.mkdir()
        assert len(mistakes(page + rest, folder)) == n


def test_the_glossary_has_the_words_that_are_printed(root: Path) -> None:
    from rthstrack.verdict import display, limits, warnings

    glossary = (root / "docs/glossary.md").read_text(encoding="utf-8")
    words = [name for name, *_ in display.INDICES]
    words += [*display.ESTIMATORS, *display.ESTIMATORS.values(), *limits.CONCLUSIONS, *limits.CONCLUSIONS.values()]
    words += [*warnings._BAD_WORDS, "held"]
    assert [word for word in words if word not in glossary] == []
