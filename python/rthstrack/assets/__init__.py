"""Style and scripts of report and live page."""

from __future__ import annotations

import base64
import hashlib
from importlib import resources


def asset(name: str) -> str:
    """The text of one of the files beside this one."""
    return (resources.files(__name__) / name).read_text(encoding="utf-8")


def digest(text: str) -> str:
    """The text's hash as a content security policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
