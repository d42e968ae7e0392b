"""MATLAB up to v7, v7.3 with objects: read by `mat_worker` in a process of its own."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rthstrack.recording.readers.apart import read_apart
from rthstrack.recording.readers.mat_worker import restore

if TYPE_CHECKING:
    from rthstrack.recording.readers.contents import Contents


def read(path: Path) -> Contents:
    """Reads a MATLAB file. Raises RecordingError if the file is damaged."""
    with tempfile.TemporaryDirectory(prefix="rthstrack-") as folder:
        out = str(Path(folder, "contents.npz"))
        read_apart("mat_worker", path, out, "MATLAB")
        return restore(out)
