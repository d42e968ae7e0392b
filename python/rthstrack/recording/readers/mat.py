"""MATLAB v4, v5 and v7, read by `mat_worker` in a process of its own: a crash there is an error here."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.mat_worker import restore

if TYPE_CHECKING:
    from rthstrack.recording.readers.contents import Contents

# How long the reading may take: a fixed time, and more for large files.
TIMEOUT_S = 60.0
TIMEOUT_S_PER_BYTE = 1e-6


def read(path: Path) -> Contents:
    """Reads a MATLAB v4, v5 or v7 file.

    Raises RecordingError if the file is damaged, also where the reading process crashes, hangs or wants too much.
    """
    timeout = TIMEOUT_S + TIMEOUT_S_PER_BYTE * path.stat().st_size
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "default"}
    # -P: a module in the current directory is not to be taken for one of ours.
    command = [sys.executable, "-P", "-m", "rthstrack.recording.readers.mat_worker"]
    with tempfile.TemporaryDirectory(prefix="rthstrack-") as folder:
        out = str(Path(folder, "contents.npz"))
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
            raise RecordingError(
                f"the file is damaged: reading it as MATLAB v5 took more than {timeout:.0f} s"
            ) from None
        if done.returncode != 0:
            said = [line.strip() for line in done.stderr.decode("utf-8", "replace").splitlines() if line.strip()]
            why = said[-1] if done.returncode == 1 and said else f"it crashed the reading process ({done.returncode})"
            raise RecordingError(f"the file is damaged, or no MATLAB v5 file: {why[:300]}")
        return restore(out)
