"""Libraries that a damaged file can bring down read in a process of their own: a crash there is an error here."""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
from typing import TYPE_CHECKING

from rthstrack.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# How long the reading may take: a fixed time, and more for large files.
TIMEOUT_S = 60.0
TIMEOUT_S_PER_BYTE = 1e-6
# Address space the process may take beside a multiple of the file (zlib packs at most 1032 to 1).
_LEAST_BYTES = 4 << 30
_BYTES_PER_BYTE = 1100


def read_apart(module: str, path: Path, out: str, called: str) -> None:
    """Runs `python -m rthstrack.recording.readers.MODULE FILE OUT`.

    Raises RecordingError if the file is damaged, also where the process crashes, hangs or wants too much.
    """
    timeout = TIMEOUT_S + TIMEOUT_S_PER_BYTE * path.stat().st_size
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "default"}
    # -P: a module in the current directory is not to be taken for one of ours.
    command = [sys.executable, "-P", "-m", f"rthstrack.recording.readers.{module}"]
    try:
        done = subprocess.run(
            [*command, str(path.absolute()), out],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=timeout,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise RecordingError(f"the file is damaged: reading it as {called} took more than {timeout:.0f} s") from None
    if done.returncode != 0:
        said = [line.strip() for line in done.stderr.decode("utf-8", "replace").splitlines() if line.strip()]
        why = said[-1] if done.returncode == 1 and said else f"it crashed the reading process ({done.returncode})"
        raise RecordingError(f"the file is damaged, or no {called} file: {why[:300]}")


def work(read: Callable[[], None], file_bytes: int) -> int:
    """What such a process does; what is wrong goes to standard error, one line. Returns the exit status."""
    _limit_memory(file_bytes)
    gc.disable()  # one file is read, and that is all
    try:
        read()
    except Exception as error:
        print(first_line(error), file=sys.stderr)
        return 1
    return 0


def first_line(error: Exception) -> str:
    """The first line of an exception that says something."""
    return next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)


def _limit_memory(file_bytes: int) -> None:
    """A damaged length must not take the machine's memory. (Systems without the limit have the timeout only.)"""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        limit = _LEAST_BYTES + _BYTES_PER_BYTE * file_bytes
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard == resource.RLIM_INFINITY or limit < hard:
            resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
