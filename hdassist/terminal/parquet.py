"""Rows as a Parquet file, in memory: columns are packed, so a million rows take some ten megabytes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from hdassist.errors import DataError

BATCH = 50_000  # rows of a group
PARQUET_SUFFIX = ".parquet"


def require_pyarrow() -> None:
    """Raise DataError where pyarrow is not installed."""
    try:
        import pyarrow.parquet  # noqa: F401 (is it there?)
    except ImportError:
        words = "Parquet needs the package pyarrow, which is not installed"
        raise DataError(words, 'pip install "hdassist[parquet]"') from None


def parquet_bytes(columns: Mapping[str, type], rows: Iterable[Sequence[Any]], about: Mapping[str, Any]) -> bytes:
    """Rows as the bytes of a Parquet file.

    Arguments: columns, name and type (float, int or str) of each; rows, None where there is no value; about, kept as
    JSON under the key "hdassist" of the file. Raises DataError: pyarrow is not installed.
    """
    require_pyarrow()
    import pyarrow
    import pyarrow.parquet

    types = {float: pyarrow.float64(), int: pyarrow.int64(), str: pyarrow.string()}
    schema = pyarrow.schema(
        [(name, types[kind]) for name, kind in columns.items()], {"hdassist": json.dumps(about, allow_nan=False)}
    )
    sink = pyarrow.BufferOutputStream()
    with pyarrow.parquet.ParquetWriter(sink, schema) as writer:
        left = iter(rows)
        while some := list(islice(left, BATCH)):
            columns_of_some = zip(zip(*some, strict=True), schema.types, strict=True)
            writer.write_batch(pyarrow.record_batch([pyarrow.array(*pair) for pair in columns_of_some], schema=schema))
    return bytes(sink.getvalue())
