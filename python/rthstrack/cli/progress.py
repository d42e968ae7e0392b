"""Progress on standard error."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator


@contextmanager
def stages() -> Iterator[Callable[[str, int, int], Any] | None]:
    """Takes (stage, done, total) and shows a bar a stage, where standard error is a terminal; else None."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress, TaskID

    with Progress(console=Console(stderr=True), transient=True) as bar:
        tasks: dict[str, TaskID] = {}

        def tell(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=total)
            bar.update(tasks[stage], completed=done, total=total)

        yield tell


@contextmanager
def stage(name: str) -> Iterator[Callable[[int, int], Any] | None]:
    """The same for one stage: takes (done, total)."""
    with stages() as tell:
        yield None if tell is None else partial(tell, name)


def counted(name: str, outcomes: Iterable[Any], total: int) -> Iterator[Any]:
    """The outcomes as they come, counted on a bar."""
    with stage(name) as tell:
        for done, outcome in enumerate(outcomes, start=1):
            if tell is not None:
                tell(done, total)
            yield outcome
