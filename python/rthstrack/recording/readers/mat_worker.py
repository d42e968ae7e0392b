"""Reads a MATLAB v4, v5 or v7 file in a process of its own: `python -m rthstrack.recording.readers.mat_worker IN OUT`.

A damaged file can bring `scipy.io.loadmat` down with the whole process, so that it must not be ours. OUT is an npz:
`contents`, a JSON text, and one array per channel.
"""

from __future__ import annotations

import contextlib
import json
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from rthstrack.recording.readers.contents import Contents, RateStatement, Series
from rthstrack.recording.readers.matlab import Cell, Node, Opaque, Struct, contents

# Address space the process may take beside a multiple of the file (zlib packs at most 1032 to 1).
_LEAST_BYTES = 4 << 30
_BYTES_PER_BYTE = 1100


def main(file: str, out: str) -> int:
    """Reads FILE and writes OUT; what is wrong goes to standard error, one line. Returns the exit status."""
    _limit_memory(Path(file).stat().st_size)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = read(file)
    except Exception as error:
        line = next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)
        print(line, file=sys.stderr)
        return 1
    store(found, [str(w.message).splitlines()[0] for w in caught if str(w.message)], out)
    return 0


def read(file: str) -> Contents:
    """The file's contents, read in this process."""
    from scipy.io import loadmat
    from scipy.io.matlab import matfile_version

    variables = loadmat(file, chars_as_strings=True, squeeze_me=False, struct_as_record=True)
    nodes = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            node, real_name = _node(value, 0), name
            if isinstance(node, Opaque) and node.is_object and name == "None":
                # SciPy before 1.18 files every object under this name.
                real_name = _field(value, "s0") or name
            nodes[real_name] = node
    return contents("MATLAB v4" if matfile_version(file)[0] == 0 else "MATLAB v5", nodes)


def _node(value: Any, depth: int) -> Node:
    from scipy.io.matlab import MatlabFunction, MatlabOpaque

    if depth > 40:
        return Opaque("nested too deep", False)
    if isinstance(value, MatlabOpaque):
        return Opaque(_field(value, "s2") or _field(value, "_Class") or "object", True)
    if isinstance(value, MatlabFunction):
        return Opaque("a function handle", False)
    if not isinstance(value, np.ndarray):
        return Opaque("a sparse matrix" if hasattr(value, "tocsc") else f"a {type(value).__name__}", False)
    if value.dtype.names:
        elements = value.ravel(order="F")
        return Struct([{key: _node(one[key], depth + 1) for key in value.dtype.names} for one in elements])
    if value.dtype.kind == "O":
        return Cell([_node(one, depth + 1) for one in value.ravel(order="F")])
    if value.dtype.kind in "US":
        return "".join(str(row) for row in value.ravel(order="F"))
    return np.asarray(value)


def _field(value: Any, key: str) -> str | None:
    """A text field of SciPy's record of an opaque object."""
    if value.dtype.names is None or key not in value.dtype.names:
        return None
    entry = value[key].ravel()[0]
    if isinstance(entry, np.ndarray):
        entry = entry.ravel()[0] if entry.size else ""
    return entry.decode("latin-1") if isinstance(entry, bytes) else str(entry)


def store(found: Contents, warned: list[str], out: str) -> None:
    """Writes contents as an npz without pickles."""
    head = {
        "format": found.format,
        "series": [[one.name, one.path, one.unit, one.start_s] for one in found.series],
        "statements": [[one.source, one.rate_hz] for one in found.statements],
        "notes": [*found.notes, *warned],
        "nameless": found.nameless,
    }
    arrays: dict[str, Any] = {f"a{i}": one.values for i, one in enumerate(found.series)}
    np.savez(out, contents=np.array(json.dumps(head)), **arrays)


def restore(out: str) -> Contents:
    """Reads back what `store` wrote."""
    with np.load(out, allow_pickle=False) as arrays:
        head = json.loads(str(arrays["contents"]))
        named = enumerate(head["series"])
        series = tuple(Series(name, path, unit, arrays[f"a{i}"], start) for i, (name, path, unit, start) in named)
    statements = tuple(RateStatement(source, rate) for source, rate in head["statements"])
    return Contents(head["format"], series, (), statements, tuple(head["notes"]), head["nameless"])


def _limit_memory(file_bytes: int) -> None:
    """A damaged length must not take the machine's memory. (Systems without the limit have the timeout only.)"""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        limit = _LEAST_BYTES + _BYTES_PER_BYTE * file_bytes
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard == resource.RLIM_INFINITY or limit < hard:
            resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
