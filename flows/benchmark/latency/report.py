"""Make a latency report of some scenes and write it: Parquet, Markdown and one HTML page."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.benchmark.latency.document import Measured, latency_document
from flows.benchmark.latency.machine import this_machine
from flows.benchmark.latency.markdown import latency_markdown
from flows.benchmark.latency.measured import (
    Engine,
    Measurement,
    MeasurementFailed,
    measured_timings,
)
from flows.benchmark.latency.page import latency_page
from flows.benchmark.latency.parquet import latency_parquet
from flows.benchmark.latency.recorded import recorded_timings
from flows.benchmark.latency.scenes import FoundScenes, find_scenes
from flows.benchmark.latency.timing import SceneTiming
from flows.preset import Preset
from storage import Store

Json = dict[str, Any]
Tell = Callable[[str], None]

NAMED = 6
"""Unknown steps that are named; --json names all."""

FILES = ("latency.parquet", "latency.md", "latency.html")


@dataclass(frozen=True)
class LatencyOptions:
    """How a report is made.

    Without ``execute`` it is read from the store and nothing is executed. ``packages`` is
    where the scenes' packages are; what a collection says, or ``scenes``, if not given.
    """

    execute: bool = False
    repeat: int = 1
    engine: Engine = "prefect"
    packages: Path | None = None
    preset: Preset | None = None


def write_latency_report(
    paths: Iterable[Path | str],
    out: Path | str,
    store_address: Path | str,
    options: LatencyOptions = LatencyOptions(),
    tell: Tell = lambda _: None,
) -> Json:
    """Measure, or read, the scenes that ``paths`` name and write the report to ``out``.

    Returns the report as one JSON value (``garden.latency/1``, see docs/latency.md).

    Raises:
        WrongUse, BadInput, UnreadableInput: a path names no scene that can be read.
        StoreMissing: there is nothing to read.
        OSError: the report cannot be written.

    A scene whose process died is told under what is absent.
    """
    found = find_scenes([Path(p) for p in paths], options.packages, options.preset)
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    if options.execute:
        measured = _measure(found, Measurement(folder, options.engine, options.repeat), tell)
    else:
        measured = _read(found, Store.open(store_address, create=False), options.repeat, tell)
    document = latency_document(measured)
    contents = (
        latency_parquet(measured.timings),
        latency_markdown(document).encode(),
        latency_page(document, measured).encode(),
    )
    for name, content in zip(FILES, contents, strict=True):
        _replace(folder / name, content)
    return document


def _measure(found: FoundScenes, how: Measurement, tell: Tell) -> Measured:
    timings: list[SceneTiming] = []
    load, machine = os.getloadavg()[0], this_machine()
    for request in found.requests:
        tell(f"running {request.name} cold, warm and cached, {how.repeat} times")
        try:
            timings += measured_timings(request, how)
        except MeasurementFailed as error:  # one scene stops no other
            found.unreadable.append(str(error))
            tell(str(error))
    times = "once" if how.repeat == 1 else f"{how.repeat} times"
    source = (
        f"Every scene was run {times} from an empty store with the {how.engine} engine, "
        "nothing else of this report at the same time. Before, the machine had a load of "
        f"{load:.1f} on {machine.cores} cores."
    )
    absent = tuple(_absent(found, timings))
    return Measured(tuple(timings), source, machine, absent, len(found.unreadable))


def _read(found: FoundScenes, store: Store, repeat: int, tell: Tell) -> Measured:
    timings: list[SceneTiming] = []
    for request in found.requests:
        tell(f"reading {request.name}")
        timings += recorded_timings(request, store, repeat)
    source = (
        "Read from the store: cold seconds are those of the run that computed each step, "
        "whatever else ran on its machine at the time; cached seconds were "
        "measured now, in a process that had planned the scene before."
    )
    absent = [
        "warm seconds and the clock of whole processes: they are measured only by --run",
        *_absent(found, timings),
    ]
    lost = len(found.unreadable)
    return Measured(tuple(timings), source, this_machine(), tuple(absent), lost)


def _absent(found: FoundScenes, timings: list[SceneTiming]) -> Iterable[str]:
    """Give a sentence on everything that the report cannot show."""
    yield from (f"{reason} (not measured)" for reason in found.unreadable)
    for request in found.requests:
        own = [timing for timing in timings if timing.scene == request.name]
        if not own:
            continue
        for timing in own:
            if timing.missing:
                yield (
                    f"{request.name}: no {timing.mode} total, nothing is known of "
                    f"{_listed(timing.missing)}; it is left out of what is said over scenes"
                )
        if not any(timing.mode == "cached" for timing in own):
            yield f"{request.name}: no cached seconds, a rerun would have something to do"
        runs = {s.run_id for t in own if t.mode == "cold" for s in t.steps if s.run_id}
        if len(runs) > 1:
            yield (
                f"{request.name}: its cold seconds were put together from {len(runs)} runs, so no "
                "clock went over all of them"
            )


def _listed(names: tuple[str, ...]) -> str:
    rest = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {rest} more steps" if rest > 0 else "")


def _replace(path: Path, content: bytes) -> None:
    staged = path.with_name(f".{path.name}.{os.getpid()}")
    staged.write_bytes(content)
    staged.replace(path)
