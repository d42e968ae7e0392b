"""Nothing branches on wording: a message is written for people, and programs read its code."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import rthstrack

if TYPE_CHECKING:
    from collections.abc import Iterator

PACKAGE = Path(rthstrack.__file__).parent

# What a text is asked with.
ASKING = {
    "startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition", "split", "rsplit", "replace",
    "find", "rfind", "index", "count", "search", "match", "fullmatch", "compile", "sub", "subn", "findall", "finditer",
}  # fmt: skip
# What holds a message by its name: of these not even a word is asked.
MESSAGES = {"error", "message", "reason", "why", "warning", "missing", "note", "said", "words"}
SENTENCE = re.compile(r"[^\W\d_][,:;]? [^\W\d_]")
WORD = re.compile(r"[^\W\d_]{2}")

# (module, what is asked): why it stands.
ALLOWED = {
    ("cli/monitor_options.py", "--log, its readings"): "a key of its own table",
    ("live/view.py", "not determined: "): "a reason is shown without what its colour says already",
}


def literals(node: ast.expr, constants: dict[str, ast.expr]) -> list[str]:
    """All texts that stand in an expression, that of the module's constants too."""
    node = constants.get(node.id, node) if isinstance(node, ast.Name) else node
    return [n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def is_message(node: ast.expr) -> bool:
    """Whether an expression is what holds a message, or the text of it."""
    while isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "str" and node.args:
        node = node.args[0]
    if isinstance(node, ast.Name):
        return node.id in MESSAGES
    if isinstance(node, ast.Attribute):
        return node.attr in MESSAGES
    return (
        isinstance(node, ast.Subscript)
        and isinstance(node.slice, ast.Constant)
        and node.slice.value in {*MESSAGES, "text"}
    )


def questions(tree: ast.Module) -> Iterator[tuple[ast.expr, ast.expr, ast.expr]]:
    """Every place where a text is asked for another: the place, the text, and what it is asked for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
                if isinstance(operator, ast.In | ast.NotIn):
                    yield node, right, left
                if isinstance(operator, ast.Eq | ast.NotEq | ast.In | ast.NotIn):
                    yield node, left, right
                if isinstance(operator, ast.Eq | ast.NotEq):
                    yield node, right, left
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ASKING:
            for argument in node.args[:1]:
                yield node, node.func.value, argument
            # re.search("...", text)
            for text in node.args[1:]:
                yield node, text, node.args[0]


def found(source: str) -> list[tuple[int, str]]:
    """Line and literal of each question that is asked of wording."""
    tree = ast.parse(source)
    constants: dict[str, ast.expr] = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name) and isinstance(node.value, ast.Constant)
    }
    lines = {}
    for place, text, asked in questions(tree):
        of_message, texts = is_message(text), literals(asked, constants)
        for literal in texts:
            if SENTENCE.search(literal) or (of_message and WORD.search(literal)):
                lines[place.lineno, literal] = None
        # The file that it names, or what else a variable holds.
        if of_message and not texts and isinstance(place, ast.Call):
            lines[place.lineno, ast.unparse(asked)] = None
    return list(lines)


@pytest.mark.parametrize(
    "source",
    [
        'if missing.startswith("the delay seems to lie beyond"): pass',
        'hint = "NaN" in str(error)',
        '_UNCERTAIN = re.compile(r"noise leaves the delay uncertain by ([.0-9]+) ms either way")',
        '_NO_MOTION = "measured does not move"\nif said == _NO_MOTION: pass',
        'share = [True for why in moving.reason if "too little motion" in str(why)]',
        'cause = said.partition("; left out of")[0]',
        'alarm = event["text"].startswith("advisory: no sample for")',
        'if tracking.reason != "too short": pass',
        "text = message if message.startswith(file) else other",
    ],
)
def test_a_question_asked_of_wording_is_found(source: str) -> None:
    assert found(source)


@pytest.mark.parametrize(
    "source",
    [
        'if tracking.reason_code == "still": pass',
        'if warning.code in ("drift", "offset"): pass',
        "if not tracking.reason: pass",
        'name.endswith("_s")',
        '"drift" in found',
        'text.partition(" (")[0]',
        'raise SignalError(f"no samples: {error}")',
    ],
)
def test_codes_names_and_signs_are_none(source: str) -> None:
    assert not found(source)


def test_nothing_in_the_package_branches_on_wording() -> None:
    asked = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        module = path.relative_to(PACKAGE).as_posix()
        if module.startswith("recording/readers/"):
            continue  # what a reader asks is the words of a file
        for line, literal in found(path.read_text(encoding="utf-8")):
            asked.setdefault((module, literal), line)
    new = [
        f"{module}:{line}: {literal!r}" for (module, literal), line in asked.items() if (module, literal) not in ALLOWED
    ]
    assert not new, "a message is asked for its words; ask for its code instead:\n" + "\n".join(new)
    assert not set(ALLOWED) - set(asked), "these are allowed, but no longer there"
