"""MATLAB v7.3: HDF5 with MATLAB's own customs (dimensions reversed, cells and structs by reference)."""

from __future__ import annotations

import contextlib
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from rthstrack.errors import RecordingError
from rthstrack.recording.readers import mat
from rthstrack.recording.readers.hdf5 import check_size
from rthstrack.recording.readers.matlab import SPARSE, Cell, Opaque, Struct, contents, has_objects

if TYPE_CHECKING:
    from pathlib import Path

    from rthstrack.recording.readers.contents import Contents
    from rthstrack.recording.readers.matlab import Node

_DEEPEST = 32


def read(path: Path) -> Contents:
    """Reads a MATLAB v7.3 file."""
    if not h5py.is_hdf5(path):
        raise RecordingError("a MATLAB v7.3 file without the HDF5 content behind its header; it is truncated")
    with h5py.File(path, "r") as file:
        names = [name for name in file if not name.startswith("#")]
        nodes = {name: _node(file, file.get(name), 0) for name in names}
    found = contents("MATLAB v7.3", nodes)
    if find_spec("matio") is not None and any(map(has_objects, nodes.values())):
        # What cannot be read as an object is told as above.
        with contextlib.suppress(RecordingError):
            return mat.read(path)
    return found


def _class(item: Any) -> str:
    found = item.attrs.get("MATLAB_class", b"")
    return found.decode("latin-1") if isinstance(found, bytes) else str(found)


def _node(file: h5py.File, item: Any, depth: int) -> Node:
    if item is None or depth > _DEEPEST:
        return Opaque("a broken link" if item is None else "nested too deep", False)
    kind = _class(item)
    if "MATLAB_object_decode" in item.attrs or kind == "MCOS":
        return Opaque(kind or "object", kind != "function_handle")
    if isinstance(item, h5py.Group):
        if "MATLAB_sparse" in item.attrs:
            return SPARSE
        return _struct(file, item, depth)
    if not isinstance(item, h5py.Dataset) or item.shape is None:
        return Opaque("empty", False)
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.zeros(0)
    check_size(item)
    values = np.asarray(item[()])
    if item.dtype.kind == "O":
        # MATLAB counts along its first dimension, which is HDF5's last.
        return Cell([_node(file, _follow(file, ref), depth + 1) for ref in values.ravel()])
    if kind == "char":
        return "".join(map(chr, values.ravel().astype(np.uint16).tolist()))
    if kind == "function_handle" or values.dtype.names:
        return Opaque("complex numbers" if values.dtype.names else "a function handle", False)
    return values.T


def _struct(file: h5py.File, group: h5py.Group, depth: int) -> Struct:
    """A group is one struct; where its fields are bare references, an array of structs."""
    fields = {name: group.get(name) for name in group}
    bare = [f for f in fields.values() if isinstance(f, h5py.Dataset) and f.dtype.kind == "O" and not _class(f)]
    if fields and len(bare) == len(fields):
        columns = {}
        for name, dataset in fields.items():
            check_size(dataset)
            columns[name] = [_node(file, _follow(file, ref), depth + 1) for ref in np.asarray(dataset[()]).ravel()]
        n_elements = min(map(len, columns.values()))
        return Struct([{name: column[i] for name, column in columns.items()} for i in range(n_elements)])
    return Struct([{name: _node(file, item, depth + 1) for name, item in fields.items()}])


def _follow(file: h5py.File, reference: Any) -> Any:
    return file[reference] if isinstance(reference, h5py.Reference) and reference else None
