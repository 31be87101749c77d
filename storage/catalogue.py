"""Keep one table of all that was done, for lists and reports: derived, and never trusted.

``catalog/part-<digest>.parquet`` hold rows read from the action records. Whoever asks for the
table gets those rows whose action still stands, and the rows of newer actions, read from
their records. A part that is damaged, missing or old costs time and nothing else.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from storage.actions import ActionRecord
from storage.digest import digest_bytes, digest_value, hexadecimal

if TYPE_CHECKING:
    from storage.medium import Medium

_PLACE = "catalog/"
_WORTH_A_PART = 200  # new rows; fewer are read from their records each time

_IDENTITY = ("action", "recorded")

COLUMNS = {
    "key": "string",
    "step": "string",
    "version": "int64",
    "scene": "string",
    "label": "string",
    "output": "string",
    "kind": "string",
    "content": "string",
    "object": "string",
    "bytes": "int64",
    "load_s": "double",
    "compute_s": "double",
    "publish_s": "double",
    "wait_s": "double",
    "peak_mb": "double",
    "status": "string",
    "backend": "string",
    "host": "string",
    "run_id": "string",
    "attempt": "int64",
    "started": "double",
    "code": "string",
    "why": "string",
    "action": "string",
    "recorded": "double",
}
"""The columns and their types. ``action`` is the name of the record, ``recorded`` and
``started`` are in Unix seconds, ``code`` is the digest of all code that the step reaches,
``why`` the code of the reason for which it ran."""


def read_catalogue(medium: Medium, *, keep: bool = True) -> Any:
    """Return a ``pyarrow.Table`` of all actions, a row an output, sorted by key.

    With ``keep`` new rows are kept in a new part when they are many, and damaged parts are
    removed; where nothing can be written nothing is kept.
    """
    import pyarrow.compute as pc

    table = _read(medium, dict(medium.times("actions/")), list(COLUMNS), keep)
    return table.take(pc.sort_indices(table, [("key", "ascending"), ("output", "ascending")]))


def read_columns(medium: Medium, *columns: str) -> list[tuple[Any, ...]]:
    """Return some columns of the table as tuples, the action that started last at the end.

    A store without parts and with few actions needs no pyarrow for this.
    """
    wanted = [*columns, "started"]
    times = dict(medium.times("actions/"))
    if len(times) < _WORTH_A_PART and not any(medium.names(_PLACE)):
        rows = [tuple(row[name] for name in wanted) for row in _rows(medium, times)]
    else:
        table = _read(medium, times, wanted, keep=True)
        rows = list(zip(*(table[name].to_pylist() for name in wanted), strict=True))
    return [row[:-1] for row in sorted(rows, key=lambda row: row[-1])]


def _read(medium: Medium, written: dict[str, float], columns: list[str], keep: bool) -> Any:
    """Return columns of the rows in parts that still hold, and of the actions not in them.

    ``written`` says which actions there are, and since when.
    """
    import pyarrow as pa

    needed = list(dict.fromkeys([*columns, *_IDENTITY]))
    parts, damaged = _read_parts(medium, needed)
    known = pa.concat_tables([_table([]).select(needed), *_distinct(parts, written)])
    held = set(known["action"].to_pylist())
    missing = _table(_rows(medium, {n: t for n, t in written.items() if n not in held}))
    if keep:
        with suppress(OSError):
            medium.delete(*damaged)
            if len(missing) >= _WORTH_A_PART:
                _keep_part(medium, missing)
    return pa.concat_tables([known, missing.select(needed)]).select(columns)


def compact(medium: Medium) -> int:
    """Put all rows into one part and remove the others; return the number of rows."""
    before = list(medium.names(_PLACE))
    table = read_catalogue(medium, keep=False)
    kept = _keep_part(medium, table)
    medium.delete(*(name for name in before if name != kept))
    return len(table)


def damaged_parts(medium: Medium) -> list[str]:
    """Return the parts whose bytes are not those that were written."""
    return [
        name
        for name in medium.names(_PLACE)
        if (data := medium.read(name)) is not None and name != _part_name(data)
    ]


def row(record: ActionRecord, output: str, name: str, recorded: float) -> dict[str, Any]:
    """Return the row of one output of an action."""
    made = record.outputs[output]
    seconds = record.seconds
    return {
        "key": record.key,
        "step": record.step,
        "version": int(record.parts.get("version", 0)),
        "scene": record.scene,
        "label": record.label,
        "output": output,
        "kind": made.kind,
        "content": made.content,
        "object": made.object,
        "bytes": made.bytes,
        **{f"{part}_s": seconds.get(part, 0.0) for part in ("load", "compute", "publish", "wait")},
        "peak_mb": record.peak_mb,
        "status": record.verdict.get("status", ""),
        "backend": record.backend,
        "host": record.host,
        "run_id": record.run_id,
        "attempt": record.attempt,
        "started": record.started,
        "code": digest_value(record.parts.get("code", {}), domain="garden.code/1"),
        "why": record.why.get("code", ""),
        "action": name,
        "recorded": recorded,
    }


def _rows(medium: Medium, written: dict[str, float]) -> Iterable[dict[str, Any]]:
    for name, recorded in written.items():
        data = medium.read(name)
        with suppress(ValueError, KeyError, TypeError, AttributeError):
            if data is not None:
                record = ActionRecord.from_bytes(data)
                for output in record.outputs:
                    yield row(record, output, name, recorded)


def _table(rows: Iterable[dict[str, Any]]) -> Any:
    import pyarrow as pa

    types = {"string": pa.string(), "int64": pa.int64(), "double": pa.float64()}
    schema = pa.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    return pa.Table.from_pylist(list(rows), schema)


def _distinct(parts: list[Any], written: dict[str, float]) -> Iterable[Any]:
    """Give the rows whose action stands as it was read; each action from one part only."""
    import pyarrow as pa

    taken: set[str] = set()
    for part in parts:
        names = part["action"].to_pylist()
        stands = [
            name not in taken and written.get(name) == recorded
            for name, recorded in zip(names, part["recorded"].to_pylist(), strict=True)
        ]
        taken.update(name for name, good in zip(names, stands, strict=True) if good)
        yield part.filter(pa.array(stands, pa.bool_()))


def _read_parts(medium: Medium, columns: list[str]) -> tuple[list[Any], list[str]]:
    """Return the tables of the sound parts, and the names of the others."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = _table([]).schema
    tables, damaged = [], []
    for name in medium.names(_PLACE):
        data = medium.read(name)
        if data is None:
            continue
        table = None
        if name == _part_name(data):
            with suppress(pa.ArrowInvalid, OSError):
                part = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
                if part.schema_arrow.equals(schema):
                    table = part.read(columns).select(columns)
        if table is not None:
            tables.append(table)
        else:
            damaged.append(name)
    return tables, damaged


def _keep_part(medium: Medium, table: Any) -> str:
    """Write a part, named by its bytes; return its name."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    data = sink.getvalue()
    name = _part_name(data)
    medium.create(name, data)
    return name


def _part_name(data: bytes) -> str:
    return f"{_PLACE}part-{hexadecimal(digest_bytes(data))[:32]}.parquet"
