"""Apache Parquet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow.parquet as pq

from rthstrack.errors import RecordingError
from rthstrack.recording.readers.arrow import contents_of

if TYPE_CHECKING:
    from pathlib import Path

    from rthstrack.recording.readers.contents import Contents

# More values than this are no recording but a damaged count.
_MOST_BYTES = 1 << 35


def read(path: Path) -> Contents:
    """Reads the columns; nulls are NaN, timestamps tell the time, metadata may state units and rate."""
    with pq.ParquetFile(path) as file:
        claimed = file.metadata.num_rows * file.metadata.num_columns * 8
        if claimed > _MOST_BYTES:
            raise RecordingError(f"damaged: it claims {file.metadata.num_rows} rows")
        table = file.read()
    return contents_of("Parquet", table, [])
