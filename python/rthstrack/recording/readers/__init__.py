"""Readers for the files that laboratories have, one module per format, chosen by content."""

from __future__ import annotations

import os
import re
import struct
import threading
import warnings
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rthstrack.errors import RecordingError, SettingError, printable
from rthstrack.recording.readers.contents import WHOLE, Part

if TYPE_CHECKING:
    from rthstrack.recording.readers.contents import Contents


class Beginning(NamedTuple):
    """What tells a file's format: its path, its first bytes, and whether it is HDF5, perhaps behind a user block."""

    file: Path
    head: bytes
    is_hdf5: bool

    def starts(self, *signatures: bytes) -> bool:
        """Whether it begins with one of these."""
        return self.head.startswith(signatures)


class Format(NamedTuple):
    """A file format: its name and what help calls it, its module, usual endings, and how it is recognised.

    `module` has a function `reader` (path) -> Contents, or (path, part) where the format `has_parts`.
    """

    name: str
    called: str
    module: str
    endings: tuple[str, ...]
    recognises: Callable[[Beginning], bool]
    reader: str = "read"
    has_parts: bool = False

    def read(self, file: Path, part: Part = WHOLE) -> Contents:
        """Everything in a file of this format, or a part of it."""
        if part != WHOLE and not self.has_parts:
            formats = " and ".join(dict.fromkeys(one.called for one in FORMATS if one.has_parts))
            raise RecordingError(
                f"block and lines choose a part of {formats} files; this one is {self.name}", code="no_parts"
            )
        read = getattr(import_module(f"{__name__}.{self.module}"), self.reader)
        found: Contents = read(file, part) if self.has_parts else read(file)
        return found


# A module is loaded to look closer, where a word or signature speaks for its format.


def _is_at2(b: Beginning) -> bool:
    if b.file.suffix.lower() != ".at2":
        with b.file.open("rb") as opened:
            if b"NPTS" not in opened.read(4096).upper():
                return False
    from rthstrack.recording.readers import at2

    return at2.recognised(b.file)


def _is_accelerogram(b: Beginning) -> bool:
    text = b.head.lower()
    if not any(word in text for word in (b"accel", b"event_name:", b"sampling_interval_s:", b"origin time")):
        return False
    from rthstrack.recording.readers import accelerograms

    return accelerograms.kind(b.head) is not None


def _is_tdm(b: Beginning) -> bool:
    # The numbers beside it begin with nothing that would tell what they are.
    return b"<usi:tdm" in b.head or (b.file.suffix.lower() == ".tdx" and b.file.with_suffix(".tdm").is_file())


def _is_workbook(b: Beginning) -> bool:
    if not b.starts(b"PK\3\4", b"\xd0\xcf\x11\xe0"):
        return False
    from rthstrack.recording.readers import excel

    return b.starts(b"\xd0\xcf\x11\xe0") or (b.starts(b"PK\3\4") and excel.recognised(b.file))


def _is_matlab(b: Beginning) -> bool:
    return not b.is_hdf5 and (b.starts(b"MATLAB 5.0") or b.head[126:128] in (b"IM", b"MI") or _is_mat4(b.head))


#: Every format, in the order in which they are looked for: the last is what no other is.
FORMATS = (
    Format("MATLAB", "MATLAB", "mat", (".mat",), _is_matlab),
    Format(
        "MATLAB v7.3",
        "MATLAB",
        "mat73",
        (".mat",),
        lambda b: b.starts(b"MATLAB 7", *([b"MATLAB"] if b.is_hdf5 else [])),
    ),
    Format("HDF5", "HDF5", "hdf5", (".h5", ".hdf5", ".hdf", ".he5"), lambda b: b.is_hdf5),
    Format("TDMS", "TDMS", "tdms", (".tdms",), lambda b: b.starts(b"TDSm")),
    Format("TDM", "TDM", "tdm", (".tdm",), _is_tdm),
    Format("Parquet", "Parquet", "parquet", (".parquet", ".pq"), lambda b: b.starts(b"PAR1")),
    Format("Arrow stream", "Arrow", "arrow", (".arrows", ".arrow"), lambda b: b.starts(b"\xff\xff\xff\xff")),
    Format("Arrow file", "Arrow", "arrow", (".arrow", ".feather"), lambda b: b.starts(b"ARROW1\0\0")),
    Format("NumPy npy", "NumPy", "numpy_file", (".npy",), lambda b: b.starts(b"\x93NUMPY"), "read_npy"),
    Format("Excel", "Excel", "excel", (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"), _is_workbook, has_parts=True),
    Format("NumPy npz", "NumPy", "numpy_file", (".npz",), lambda b: b.starts(b"PK\3\4", b"PK\5\6"), "read_npz"),
    Format("accelerogram", "text", "accelerograms", (), _is_accelerogram),
    Format("PEER AT2", "text", "at2", (".at2",), _is_at2),
    Format(
        "text",
        "text",
        "text",
        (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", ".prn", ".out"),
        lambda _: True,
        has_parts=True,
    ),
)
_TEXT = FORMATS[-1]
#: What they are called in help and messages: text first.
FORMAT_NAMES = tuple(dict.fromkeys(("text", *(one.called for one in FORMATS))))
_HDF5 = b"\x89HDF\r\n\x1a\n"
_RECORDING_WARNINGS = threading.Lock()
_OTHERS = (
    (
        b"version https://git-lfs.github.com/spec/",
        "a Git LFS pointer, which stands for the file; fetch the file itself with 'git lfs pull'",
    ),
    (b"\x1f\x8b", "a gzip archive; unpack it first"),
    (b"TDSh", "the index of a TDMS file; give the .tdms file beside it"),
    (b"7z\xbc\xaf", "a 7z archive; unpack it first"),
    (b"FEA1", "a Feather file of version 1; save it as version 2 or as Parquet"),
    (b"MDF     ", "an ASAM measurement (MDF, mf4); export it as MAT or CSV"),
    (b"<!DOCTYPE html", "a web page in place of the file; download the file itself"),
    (b"<!doctype html", "a web page in place of the file; download the file itself"),
    (b"<html", "a web page in place of the file; download the file itself"),
    (b'{"', "JSON; export it as CSV"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
)


def read_contents(
    path: str | os.PathLike[str], *, block: int | None = None, lines: tuple[int, int] | None = None
) -> Contents:
    """Reads everything in a file, whatever its format; of text and workbooks a block of rows (from 1) or some lines.

    Raises RecordingError, one line with the file's name: missing, empty, damaged, of an unknown format, or without
    channels, or a part of what has none. This is the one place where a library's own exceptions end.
    """
    part = Part(block, lines)
    if block is not None and lines is not None:
        raise SettingError("block and lines exclude each other")
    file = Path(path)
    try:
        found = _format(file)
        if found is _TEXT:
            contents, caught = _read_text(file, part), []
        else:
            # The interpreter has one list of warning filters: whoever records warnings must be alone.
            with _RECORDING_WARNINGS, warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                contents = found.read(file, part)
    except RecordingError as error:
        raise _error(path, Exception.__str__(error), error) from error.__cause__
    except OSError as error:
        raise _error(path, error.strerror or _first_line(error)) from error
    except ImportError as error:
        raise _error(path, f"this format needs the package {error.name}, which cannot be imported") from error
    except MemoryError as error:
        raise _error(path, "more than the memory holds; the file is damaged or too large") from error
    except Exception as error:
        said = _first_line(error)
        # A bare number or word (KeyError: 0) says nothing without what it is.
        said = said if " " in said else f"{type(error).__name__} {said}"
        raise _error(path, f"damaged, or not as its format demands: {said}") from error
    notes = _summed([*contents.notes, *(_first_line(w.message) for w in caught)])
    if not contents.series:
        said = "; ".join(notes[:3]) or "nothing of the kind"
        raise _error(path, f"no channels; expected vectors of numbers ({contents.format}), found: {said}")
    ending = file.suffix.lower()
    if any(ending in one.endings for one in FORMATS) and found.endings and ending not in found.endings:
        notes.append(f"named {file.suffix}, but the content is {contents.format}")
    return replace(
        contents,
        series=tuple(replace(s, name=printable(s.name), path=printable(s.path)) for s in contents.series),
        clocks=tuple(replace(c, name=printable(c.name), path=printable(c.path)) for c in contents.clocks),
        notes=tuple(map(printable, notes)),
    )


def _error(path: str | os.PathLike[str], what: object, error: RecordingError | None = None) -> RecordingError:
    """One printable line that begins with the file; code, values and advice are those of the error it stands for."""
    file, words = printable(os.fspath(path)), printable(str(what))
    code, values, advice = (error.code, error.values, error.advice) if error else (None, None, "")
    room = max(1000 - len(f"{file}: ") - len(advice), 3)
    words = words if len(words) <= room else words[: room - 3] + "..."
    return RecordingError(words, file=file, code=code, values=values, advice=advice)


def _first_line(cause: object) -> str:
    """The first line of an exception or warning that says something."""
    lines = (line.strip() for line in str(cause).splitlines())
    return next((line for line in lines if line), type(cause).__name__)


def _summed(notes: list[str]) -> list[str]:
    """The notes, each once, and one for all of whom the same is to be said."""
    alike: dict[str, list[str]] = {}
    for note in dict.fromkeys(notes):
        _, mark, rest = note.rpartition("' ")
        alike.setdefault(rest if mark and note.startswith("'") else note, []).append(note)
    said = []
    for rest, group in alike.items():
        if len(group) == 1:
            said += group
        else:
            names = [note.rpartition("' ")[0] + "'" for note in group]
            listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
            said.append(f"{listed}: each {rest}")
    return said


def _format(file: Path) -> Format:
    """The format that a file's first bytes show."""
    if not file.exists():
        raise RecordingError("no such file")
    if file.is_dir():
        raise RecordingError("a folder without recordings of its own; expected a file, or a folder with files in it")
    if not file.is_file():
        raise RecordingError("not a regular file")
    with file.open("rb") as opened:
        head = opened.read(512)
        if not head:
            raise RecordingError("the file is empty")
        is_hdf5 = head.startswith(_HDF5) or _hdf5_behind_a_block(opened.seek, opened.read)
    for magic, what in _OTHERS:
        if head.startswith(magic):
            raise RecordingError(f"{what}; expected {', '.join(FORMAT_NAMES[:-1])} or {FORMAT_NAMES[-1]}")
    beginning = Beginning(file, head, is_hdf5)
    return next(one for one in FORMATS if one.recognises(beginning))


def _read_text(file: Path, part: Part) -> Contents:
    """What no signature tells is text; a name that promises something else is told where it is none."""
    named = next((one for one in FORMATS if one is not _TEXT and file.suffix.lower() in one.endings), None)
    try:
        return _TEXT.read(file, part)
    except RecordingError as error:
        if named is None:
            raise
        what = (
            f"named {file.suffix}, but it does not begin as {named.name} does, and as text: {Exception.__str__(error)}"
        )
        raise RecordingError(what, code=error.code, values=error.values, advice=error.advice) from None


def _hdf5_behind_a_block(seek: Callable[[int], int], read: Callable[[int], bytes]) -> bool:
    """HDF5's signature may stand behind a user block of 512, 1024, 2048, ... bytes."""
    for offset in (512, 1024, 2048, 4096, 8192):
        seek(offset)
        if read(8) == _HDF5:
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
