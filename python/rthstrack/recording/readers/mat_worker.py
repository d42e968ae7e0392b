"""Reads a MATLAB file in a process of its own: `python -m rthstrack.recording.readers.mat_worker IN OUT`.

A damaged file can bring `scipy.io.loadmat` down with the whole process, so that it must not be ours. OUT is an npz:
`contents`, a JSON text, and one array per channel.
"""

from __future__ import annotations

import contextlib
import json
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rthstrack.recording.readers.apart import first_line, work
from rthstrack.recording.readers.contents import Clock, Contents, RateStatement, Series
from rthstrack.recording.readers.matlab import SPARSE, Cell, Node, Opaque, Struct, contents, has_objects
from rthstrack.recording.readers.matlab_objects import object_node
from rthstrack.said import Said

# What an object's place in the file begins with, where the object itself is not found.
_REFERENCE = 0xDD000000


def main(file: str, out: str) -> int:
    """Reads FILE and writes OUT. Returns the exit status."""

    def run() -> None:
        # What SciPy and mat-io warn of is for programmers.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            store(read(file), out)

    return work(run, Path(file).stat().st_size)


def read(file: str) -> Contents:
    """The file's contents, read in this process: by SciPy, or by mat-io where there are objects or it is v7.3."""
    with open(file, "rb") as opened:
        is_v73 = opened.read(128)[124:126] in (b"\0\2", b"\2\0")
    if is_v73:
        return contents("MATLAB v7.3", _by_matio(file))
    nodes, notes = _by_scipy(file)
    if notes or any(map(has_objects, nodes.values())):
        # An object that mat-io cannot read either is told by SciPy's list.
        with contextlib.suppress(Exception):
            more = _by_matio(file)
            nodes = {**more, **{name: node for name, node in nodes.items() if name not in more}}
            notes = {name: note for name, note in notes.items() if name not in more}
    from scipy.io.matlab import matfile_version

    found = contents("MATLAB v4" if matfile_version(file)[0] == 0 else "MATLAB v5", nodes)
    return replace(found, notes=(*found.notes, *notes.values()))


def _by_matio(file: str) -> dict[str, Node]:
    from matio import load_from_mat

    variables = load_from_mat(file, raw_data=True)
    nodes = {name: _node(value, 0) for name, value in variables.items() if not name.startswith("__")}
    # A text in place of a variable is mat-io's word for one that it cannot read.
    return {name: node for name, node in nodes.items() if not isinstance(node, str | Opaque)}


def _by_scipy(file: str) -> tuple[dict[str, Node], dict[str, str]]:
    """The variables, and what is wrong with those that cannot be read while others can."""
    from scipy.io import loadmat

    options: dict[str, Any] = {"chars_as_strings": True, "squeeze_me": False, "struct_as_record": True}
    variables, notes = {}, {}
    try:
        variables = loadmat(file, **options)
    except MemoryError:
        raise
    except Exception as error:
        for name in _listed(file):
            try:
                variables.update(loadmat(file, variable_names=[name], **options))
            except Exception as why:
                notes[name] = f"'{name}' cannot be read ({first_line(why)}); save it as a plain array in MATLAB"
        if not any(name in variables for name in _listed(file)):
            raise error
    nodes = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            node, real_name = _node(value, 0), name
            if isinstance(node, Opaque) and node.is_object and name == "None":
                # SciPy before 1.18 files every object under this name.
                real_name = _field(value, "s0") or name
            nodes[real_name] = node
    return nodes, notes


def _listed(file: str) -> list[str]:
    """The names of the variables, as far as they can be read."""
    with contextlib.suppress(Exception):
        from scipy.io import whosmat

        return [name for name, *_ in whosmat(file)]
    return []


def _node(value: Any, depth: int) -> Node:
    from scipy.io.matlab import MatlabFunction, MatlabOpaque

    if depth > 40:
        return Opaque("nested too deep", False)
    if isinstance(value, MatlabOpaque):
        return Opaque(_field(value, "s2") or _field(value, "_Class") or "object", True)
    if isinstance(value, MatlabFunction) or type(value).__name__ == "MatlabFunction":
        return Opaque("a function handle", False)
    if value is None:
        return Opaque("empty", False)
    if isinstance(properties := getattr(value, "properties", None), dict):
        return object_node(value.classname, properties, lambda one: _node(one, depth + 1))
    if hasattr(value, "classname") and not isinstance(value, np.ndarray):
        return Opaque(str(value.classname), True)
    if not isinstance(value, np.ndarray):
        return SPARSE if hasattr(value, "tocsc") else Opaque(f"a {type(value).__name__}", False)
    if value.dtype.names:
        elements = value.ravel(order="F")
        return Struct([{key: _node(one[key], depth + 1) for key in value.dtype.names} for one in elements])
    if value.dtype.kind == "O":
        return Cell([_node(one, depth + 1) for one in value.ravel(order="F")])
    if value.dtype == np.uint32 and value.size > 1 and value.ravel()[0] == _REFERENCE:
        return Opaque("object", True)
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


def store(found: Contents, out: str) -> None:
    """Writes contents as an npz without pickles."""
    head = {
        "format": found.format,
        "series": [[one.name, one.path, one.unit, one.start_s] for one in found.series],
        "clocks": [[one.name, one.path, one.first_ns, one.after] for one in found.clocks],
        "statements": [[one.source, one.rate_hz, one.channel, one.in_unit] for one in found.statements],
        "notes": [[note, note.code if isinstance(note, Said) else None] for note in found.notes],
        "nameless": found.nameless,
    }
    arrays: dict[str, Any] = {f"a{i}": one.values for i, one in enumerate(found.series)}
    arrays |= {f"c{i}": one.seconds for i, one in enumerate(found.clocks)}
    np.savez(out, contents=np.array(json.dumps(head)), **arrays)


def restore(out: str) -> Contents:
    """Reads back what `store` wrote."""
    with np.load(out, allow_pickle=False) as arrays:
        head = json.loads(str(arrays["contents"]))
        named = enumerate(head["series"])
        series = tuple(Series(name, path, unit, arrays[f"a{i}"], start) for i, (name, path, unit, start) in named)
        clocks = tuple(
            Clock(name, path, arrays[f"c{i}"], first_ns, after)
            for i, (name, path, first_ns, after) in enumerate(head["clocks"])
        )
    statements = tuple(RateStatement(*one) for one in head["statements"])
    notes = tuple(text if code is None else Said(text, code) for text, code in head["notes"])
    return Contents(head["format"], series, clocks, statements, notes, head["nameless"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
