"""Write and read tables as Parquet with a checksum a page; hash what they hold."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from storage.digest import digest_bytes

if TYPE_CHECKING:
    import pyarrow


def table_bytes(table: pyarrow.Table) -> memoryview:
    """Return ``table`` as Parquet."""
    import pyarrow.parquet

    sink = io.BytesIO()
    pyarrow.parquet.write_table(
        table, sink, compression="zstd", compression_level=3, write_page_checksum=True
    )
    return sink.getbuffer()


def read_table(data: bytes) -> pyarrow.Table:
    """Return the table in Parquet bytes, page checksums verified."""
    import pyarrow.parquet

    return pyarrow.parquet.read_table(io.BytesIO(data), page_checksum_verification=True)


def table_digest(table: pyarrow.Table) -> str:
    """Return the digest of a table's columns and rows, however it is chunked.

    Hashed is the Arrow stream of the columns in order of name, in one chunk, without
    metadata: it does not depend on Parquet or on the version of pyarrow.
    """
    import pyarrow
    import pyarrow.ipc

    names = sorted(table.column_names)
    logical = table.select(names).replace_schema_metadata(None).combine_chunks()
    sink = io.BytesIO()
    with pyarrow.ipc.new_stream(sink, logical.schema) as stream:
        stream.write_table(logical)
    return digest_bytes(sink.getbuffer())
