"""Readers for the files that laboratories have, one module per format, chosen by content."""

from __future__ import annotations

import os
import re
import struct
import threading
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rthstrack.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rthstrack.recording.readers.contents import Contents

_ENDINGS = {
    "text": (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", ".prn", ".out"),
    "PEER AT2": (".at2",),
    "MATLAB": (".mat",),
    "MATLAB v7.3": (".mat",),
    "HDF5": (".h5", ".hdf5", ".hdf", ".he5"),
    "TDMS": (".tdms",),
    "Parquet": (".parquet", ".pq"),
    "Arrow stream": (".arrows", ".arrow"),
    "Arrow file": (".arrow", ".feather"),
    "NumPy npy": (".npy",),
    "NumPy npz": (".npz",),
}
_RECORDING_WARNINGS = threading.Lock()
_OTHERS = (
    (b"\xd0\xcf\x11\xe0", "an old Excel or Office file; save the sheet as CSV"),
    (b"\x1f\x8b", "a gzip archive; unpack it first"),
    (b"TDSh", "the index of a TDMS file; give the .tdms file beside it"),
    (b"7z\xbc\xaf", "a 7z archive; unpack it first"),
    (b"FEA1", "a Feather file of version 1; save it as version 2 or as Parquet"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
)


def read_contents(path: str | os.PathLike[str]) -> Contents:
    """Reads everything in a file, whatever its format.

    Raises RecordingError, one line with the file's name: missing, empty, damaged, of an unknown format, or without
    channels. This is the one place where a library's own exceptions end.
    """
    file = Path(path)
    try:
        kind, reader = _reader(file)
        if kind == "text":
            contents, caught = reader(file), []
        else:
            # The interpreter has one list of warning filters: whoever records warnings must be alone.
            with _RECORDING_WARNINGS, warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                contents = reader(file)
    except RecordingError as error:
        raise _error(path, error) from error.__cause__
    except OSError as error:
        raise _error(path, error.strerror or _first_line(error)) from error
    except ImportError as error:
        raise _error(path, f"this format needs the package {error.name}, which cannot be imported") from error
    except MemoryError as error:
        raise _error(path, "more than the memory holds; the file is damaged or too large") from error
    except Exception as error:
        raise _error(path, f"damaged, or not as its format demands: {_first_line(error)}") from error
    notes = _summed([*contents.notes, *(_first_line(w.message) for w in caught)])
    if not contents.series:
        found = "; ".join(notes[:3]) or "nothing of the kind"
        raise _error(path, f"no channels; expected vectors of numbers ({contents.format}), found: {found}")
    ending = file.suffix.lower()
    if any(ending in endings for endings in _ENDINGS.values()) and ending not in _ENDINGS[kind]:
        notes.append(f"named {file.suffix}, but the content is {contents.format}")
    return replace(
        contents,
        series=tuple(replace(s, name=_printable(s.name), path=_printable(s.path)) for s in contents.series),
        clocks=tuple(replace(c, name=_printable(c.name), path=_printable(c.path)) for c in contents.clocks),
        notes=tuple(map(_printable, notes)),
    )


def _error(path: str | os.PathLike[str], what: object) -> RecordingError:
    """One printable line that begins with the file."""
    file, words = _printable(os.fspath(path)), _printable(str(what))
    room = max(1000 - len(f"{file}: "), 3)
    return RecordingError(words if len(words) <= room else words[: room - 3] + "...", file=file)


def _printable(text: str) -> str:
    """Text from a file, which may be damaged, with control characters escaped."""
    return (
        text
        if text.isprintable()
        else "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    )


def _first_line(cause: object) -> str:
    """The first line of an exception or warning that says something."""
    lines = (line.strip() for line in str(cause).splitlines())
    return next((line for line in lines if line), type(cause).__name__)


def _summed(notes: list[str]) -> list[str]:
    """The notes, each once, and one for all of whom the same is to be said."""
    alike: dict[str, list[str]] = {}
    for note in dict.fromkeys(notes):
        name, mark, rest = note.rpartition("' ")
        alike.setdefault(rest if mark and name.startswith("'") else note, []).append(name + "'")
    said = []
    for rest, names in alike.items():
        if rest in notes:
            said.append(rest)
        else:
            listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
            said.append(f"{listed} {rest}" if len(names) == 1 else f"{listed}: each {rest}")
    return said


def _reader(file: Path) -> tuple[str, Callable[[Path], Contents]]:
    """The format that a file's first bytes show, and its reader."""
    if not file.exists():
        raise RecordingError("no such file")
    if file.is_dir():
        raise RecordingError("a directory; expected a file")
    if not file.is_file():
        raise RecordingError("not a regular file")
    with file.open("rb") as opened:
        head = opened.read(512)
        if not head:
            raise RecordingError("the file is empty")
        signed_later = _hdf5_behind_a_block(opened.seek, opened.read)
    for magic, what in _OTHERS:
        if head.startswith(magic):
            raise RecordingError(f"{what}; expected text, MATLAB, HDF5, TDMS, Parquet, Arrow or NumPy")
    if head.startswith(b"\x89HDF\r\n\x1a\n") or signed_later:
        if head.startswith(b"MATLAB 7"):
            from rthstrack.recording.readers import mat73

            return "MATLAB v7.3", mat73.read
        from rthstrack.recording.readers import hdf5

        return "HDF5", hdf5.read
    if head.startswith(b"MATLAB 5.0") or head[126:128] in (b"IM", b"MI") or _is_mat4(head):
        from rthstrack.recording.readers import mat

        return "MATLAB", mat.read
    if head.startswith(b"MATLAB 7"):
        raise RecordingError("a MATLAB v7.3 file without the HDF5 content behind its header; it is truncated")
    if head.startswith(b"TDSm"):
        from rthstrack.recording.readers import tdms

        return "TDMS", tdms.read
    if head.startswith(b"PAR1"):
        from rthstrack.recording.readers import parquet

        return "Parquet", parquet.read
    if head.startswith((b"ARROW1\0\0", b"\xff\xff\xff\xff")):
        from rthstrack.recording.readers import arrow

        return "Arrow file" if head.startswith(b"ARROW1") else "Arrow stream", arrow.read
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        from rthstrack.recording.readers import numpy_file

        return "NumPy npz", numpy_file.read_npz
    if head.startswith(b"\x93NUMPY"):
        from rthstrack.recording.readers import numpy_file

        return "NumPy npy", numpy_file.read_npy
    from rthstrack.recording.readers import at2, text

    if at2.recognised(file):
        return "PEER AT2", at2.read
    named = next((k for k, endings in _ENDINGS.items() if k != "text" and file.suffix.lower() in endings), None)
    if named is None:
        return "text", text.read

    def read_misnamed(path: Path) -> Contents:
        try:
            return text.read(path)
        except RecordingError as error:
            raise RecordingError(
                f"named {path.suffix}, but it does not begin as {named} does, and as text: {error}"
            ) from None

    return "text", read_misnamed


def _hdf5_behind_a_block(seek: Callable[[int], int], read: Callable[[int], bytes]) -> bool:
    """HDF5's signature may stand behind a user block of 512, 1024, 2048, ... bytes."""
    for offset in (512, 1024, 2048, 4096, 8192):
        seek(offset)
        if read(8) == b"\x89HDF\r\n\x1a\n":
            return True
    return False


def _is_mat4(head: bytes) -> bool:
    """MATLAB v4 has no signature but a strict first header: type, rows, columns, imaginary part, length of the name."""
    for order, machine in (("<", 0), (">", 1)):
        if len(head) >= 24:
            kind, n_rows, n_columns, imaginary, n_name = struct.unpack(order + "5i", head[:20])
            digits = (kind // 1000, kind // 100 % 10, kind // 10 % 10 < 6, kind % 10 < 3)
            name = head[20 : 19 + n_name] if 2 <= n_name <= 64 else b""
            shaped = n_rows >= 0 and n_columns >= 0 and imaginary in (0, 1)
            if digits == (machine, 0, True, True) and shaped and re.fullmatch(rb"[A-Za-z]\w*", name):
                return True
    return False
