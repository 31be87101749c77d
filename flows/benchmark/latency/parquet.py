"""Write a report's timings as one Parquet table, for queries of one's own."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from flows.benchmark.latency.timing import PARTS, SceneTiming, StepTiming
from flows.benchmark.latency.totals import scene_seconds, totals

if TYPE_CHECKING:
    import pyarrow

Row = dict[str, Any]

TEXTS = ("level", "scene", "object", "step", "mode")
NUMBERS = (
    "seconds", *(f"{part}_s" for part in PARTS), "lookup_s", "wall_s", "process_s", "render_s",
    "started", "ended", "peak_mb",
)  # fmt: skip


def latency_rows(timings: Iterable[SceneTiming]) -> Iterator[Row]:
    """Give one row a scene, object and step, for each mode and repetition.

    ``level`` says which of the three a row is. A scene without some of its steps has rows
    for those that are known, and none for itself and its objects.
    """
    for timing in timings:
        if timing.complete:
            yield _scene_row(timing)
            yield from (_object_row(timing, name) for name in timing.objects)
        yield from (_step_row(step) for step in timing.steps)


def latency_table(timings: Iterable[SceneTiming]) -> pyarrow.Table:
    """Return the rows as a table; what a row does not have is null."""
    import pyarrow

    schema = pyarrow.schema(
        [
            *((name, pyarrow.string()) for name in TEXTS),
            ("repeat", pyarrow.int32()),
            ("evaluation_only", pyarrow.bool_()),
            *((name, pyarrow.float64()) for name in NUMBERS),
            *((name, pyarrow.string()) for name in ("backend", "host", "run_id", "key")),
        ]
    )
    return pyarrow.Table.from_pylist(list(latency_rows(timings)), schema=schema)


def latency_parquet(timings: Iterable[SceneTiming]) -> bytes:
    """Return the table as a Parquet file."""
    import pyarrow.parquet

    stream = io.BytesIO()
    pyarrow.parquet.write_table(latency_table(timings), stream, write_page_checksum=True)
    return stream.getvalue()


def _scene_row(timing: SceneTiming) -> Row:
    whole = totals(timing.steps)
    return {
        **_labels("scene", timing),
        "seconds": scene_seconds(timing),
        **{f"{part}_s": seconds for part, seconds in whole.parts.items()},
        "wall_s": timing.wall_s,
        "process_s": timing.process_s,
        "render_s": whole.render,
        "peak_mb": whole.peak_mb,
    }


def _object_row(timing: SceneTiming, target: str) -> Row:
    own = totals([step for step in timing.steps if step.target == target])
    return {
        **_labels("object", timing),
        "object": target,
        "seconds": own.work,
        **{f"{part}_s": seconds for part, seconds in own.parts.items()},
        "peak_mb": own.peak_mb,
    }


def _labels(level: str, timing: SceneTiming) -> Row:
    return {
        "level": level,
        "scene": timing.scene,
        "mode": timing.mode,
        "repeat": timing.repeat,
        "evaluation_only": False,
    }


def _step_row(step: StepTiming) -> Row:
    parts = {f"{part}_s": getattr(step.seconds, part) for part in PARTS if step.seconds}
    return {
        "level": "step",
        "scene": step.scene,
        "object": step.target or None,
        "step": step.step,
        "mode": step.mode,
        "repeat": step.repeat,
        "evaluation_only": step.evaluation_only,
        "seconds": step.total_s,
        **parts,
        "lookup_s": step.lookup_s,
        "started": step.started,
        "ended": step.ended,
        "peak_mb": step.peak_mb,
        "backend": step.backend,
        "host": step.host,
        "run_id": step.run_id,
        "key": step.key,
    }
