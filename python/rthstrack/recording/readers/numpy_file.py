"""NumPy's npy and npz; never pickles."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING

import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrays import collect
from rthstrack.recording.readers.contents import Contents

if TYPE_CHECKING:
    from pathlib import Path


def read_npy(path: Path) -> Contents:
    """Reads one array: a vector is one channel, of a matrix the shorter dimension counts the channels."""
    with path.open("rb") as file:
        array = np.lib.format.read_array(file, allow_pickle=False)
        if file.read(1):
            raise RecordingError("there is content behind the array; expected one array, as np.save writes it")
    return collect("NumPy npy", [(path.stem, array, None)])


def read_npz(path: Path) -> Contents:
    """Reads named arrays; single numbers named rate_hz, fs or dt state the rate."""
    with zipfile.ZipFile(path) as archive:
        members = [name for name in archive.namelist() if name.endswith(".npy")]
        if not members:
            raise RecordingError("a zip archive; expected NumPy arrays in it (npz) or a workbook, found neither")
    entries = []
    with np.load(path, allow_pickle=False) as arrays:
        for name in arrays.files:
            try:
                entries.append((name, arrays[name], None))
            except ValueError as error:
                raise RecordingError(f"array '{name}' cannot be read: {error}") from error
    return collect("NumPy npz", entries)
