"""Say what more scenes would take, in proportion to those that were run."""

from __future__ import annotations

from collections.abc import Iterator

from flows.benchmark.orchestration.report import Row, Section
from flows.benchmark.orchestration.scale import ScaleResult

SCENES = 100_000

METHOD = """\
In proportion to what was measured above, which holds as far as a scene's cost stays flat. Only
what orchestration takes: the steps' own work and the size of their results come on top (see
docs/scale.md)."""


def plan_section(result: ScaleResult, scenes: int = SCENES) -> Section:
    """Return the table of what so many scenes of the same shape would take."""
    rows: list[Row] = [
        {
            "what": what,
            "a scene": f"{amount / result.options.scenes:.3g} {unit}",
            f"{scenes} scenes": f"{amount * scenes / result.options.scenes / per:.3g} {larger}",
        }
        for what, amount, unit, per, larger in _amounts(result)
    ]
    return Section(f"{scenes} scenes from these figures", METHOD, rows)


def _amounts(result: ScaleResult) -> Iterator[tuple[str, float, str, float, str]]:
    """Give what was used in all: amount, its unit, and how many of these a larger unit is."""
    ours = result.samples[-1].ours_cpu_s - result.samples[0].ours_cpu_s
    store = result.store.values()
    yield "wall-clock time here", result.wall_s, "s", 3600.0, "h"
    yield "CPU time of runner and workers", ours, "s", 3600.0, "h"
    yield "restart over finished scenes", result.restart.seconds, "s", 60.0, "min"
    yield "inodes of the store", sum(g.files + g.folders for g in store), "", 1e6, "million"
    yield "disk of the store", sum(g.disk_bytes for g in store) / 1e6, "MB", 1e3, "GB"
    yield "collection.json", result.state_bytes / 1e3, "KB", 1e3, "MB"
    if result.server is not None:
        grown = result.server.bytes_after - result.server.bytes_before
        yield "CPU time of the Prefect server", result.server.cpu_s, "s", 3600.0, "h"
        yield "database of the Prefect server", grown / 1e6, "MB", 1e3, "GB"
