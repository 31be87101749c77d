"""Turn what was measured of a thousand scenes into tables and claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean, median

import numpy as np

from flows.benchmark.measure import Measure
from flows.benchmark.orchestration.growth import Growth
from flows.benchmark.orchestration.plan_ahead import plan_section
from flows.benchmark.orchestration.report import Row, Section
from flows.benchmark.orchestration.sampling import Sample
from flows.benchmark.orchestration.scale import FinishedScene, ScaleResult, ServerGrowth

BLOCK = 100
LAST_OF_FIRST = 1.2
RESTART_S = 60.0
_MB = 1e6
_NAMED = 5

BLOCKS_METHOD = """\
Simulated scenes of the real flow's shape (8 steps and 5 an object, 4 KB each), run by the
collection runner in worker processes. Blocks are of scenes in the order in which they were
finished; a scene's seconds are those in its worker, medians and means; memory is the median
of samples taken every second, CPU what was used while the block was finished. "Ours" is the
runner with all its workers. The seconds also depend on what else the machine does, CPU time
hardly: both are held."""

GROWTH_METHOD = """\
Files and folders take an inode each; bytes are the files' lengths, disk bytes what the file
system gave them."""

SERVER_METHOD = """\
The server's CPU time counts until it had worked off all that it was sent. Task runs are the
steps of all scenes."""


@dataclass(frozen=True)
class Block:
    """Scenes that were finished one after another, and what was used meanwhile."""

    first: int
    scenes: list[FinishedScene]
    samples: list[Sample]
    wall_s: float
    ours_cpu_s: float
    """Of the runner and its workers."""
    server_cpu_s: float

    @property
    def scene_s(self) -> float:
        """The median seconds of a scene."""
        return median(scene.seconds for scene in self.scenes)

    @property
    def cost(self) -> float:
        """CPU seconds of all."""
        return self.ours_cpu_s + self.server_cpu_s

    @property
    def rss(self) -> float:
        """The median bytes of runner and workers."""
        return median(sample.ours_rss for sample in self.samples)


def blocks_of(result: ScaleResult) -> list[Block]:
    """Return the scenes in blocks of a hundred, or in four if there are fewer; a rest at the
    end is left out.
    """
    size = max(1, min(BLOCK, len(result.finished) // 4))
    begin = result.started
    times = [sample.time for sample in result.samples]
    ours = [sample.ours_cpu_s for sample in result.samples]
    server = [sample.server.cpu_s for sample in result.samples]
    blocks = []
    for first in range(0, len(result.finished) - size + 1, size):
        scenes = result.finished[first : first + size]
        end = scenes[-1].at
        blocks.append(
            Block(
                first,
                scenes,
                _during(result.samples, begin, end),
                end - begin,
                *(
                    float(np.diff(np.interp([begin, end], times, used))[0])
                    for used in (ours, server)
                ),
            )
        )
        begin = end
    return blocks


def _during(samples: Sequence[Sample], begin: float, end: float) -> list[Sample]:
    """Return the samples of a time, or the nearest one if it was too short for any."""
    inside = [sample for sample in samples if begin <= sample.time <= end]
    return inside or [min(samples, key=lambda sample: abs(sample.time - end))]


def scale_sections(result: ScaleResult) -> list[Section]:
    """Return the tables of a run, with the claims at the first."""
    options = result.options
    blocks = blocks_of(result)
    title = (
        f"{options.scenes} scenes of {options.objects} objects, engine {options.engine},"
        f" {options.processes} processes: {result.wall_s:.1f} s"
    )
    sections = [
        Section(
            title,
            "\n".join([BLOCKS_METHOD, *result.wrong[:_NAMED]]),
            [_block_row(b) for b in blocks],
            _claims(result, blocks),
        ),
        Section("What the store grew by", GROWTH_METHOD, _store_rows(result)),
    ]
    if result.server is not None:
        title = f"What the Prefect server grew by (settings: {options.profile})"
        sections.append(Section(title, SERVER_METHOD, _server_rows(result, result.server)))
    return [*sections, plan_section(result)]


def _claims(result: ScaleResult, blocks: list[Block]) -> tuple[Measure, ...]:
    first, last = blocks[0], blocks[-1]
    return (
        Measure(
            "a scene of the last block", last.scene_s / first.scene_s, LAST_OF_FIRST, "x first"
        ),
        Measure("CPU time of the last block", last.cost / first.cost, LAST_OF_FIRST, "x first"),
        Measure("memory in the last block", last.rss / first.rss, LAST_OF_FIRST, "x first"),
        Measure("restart over finished scenes", result.restart.seconds, RESTART_S, "s"),
        Measure("steps that the restart executed", result.restart.executed, 0, ""),
        Measure("scenes that went wrong", len(result.wrong), 0, ""),
    )


def _block_row(block: Block) -> Row:
    return {
        "scenes": f"{block.first + 1}-{block.first + len(block.scenes)}",
        "wall s": round(block.wall_s, 2),
        "scene s, median": round(block.scene_s, 3),
        "scene s, mean": round(mean(scene.seconds for scene in block.scenes), 3),
        "runner MB": round(median(s.parent.rss for s in block.samples) / _MB, 1),
        "workers MB": round(median(s.workers.rss for s in block.samples) / _MB, 1),
        "server MB": round(median(s.server.rss for s in block.samples) / _MB, 1),
        "ours CPU s": round(block.ours_cpu_s, 1),
        "server CPU s": round(block.server_cpu_s, 1),
    }


def _store_rows(result: ScaleResult) -> list[Row]:
    parts = dict(result.store)
    parts["all"] = Growth(
        *(sum(getattr(g, name) for g in result.store.values()) for name in _COUNTS)
    )
    return [_growth_row(name, grown, result) for name, grown in parts.items()]


_COUNTS = ("files", "folders", "bytes", "disk_bytes")


def _growth_row(name: str, grown: Growth, result: ScaleResult) -> Row:
    steps = result.options.steps
    return {
        "part": name,
        "files": grown.files,
        "folders": grown.folders,
        "MB": round(grown.bytes / _MB, 2),
        "disk MB": round(grown.disk_bytes / _MB, 2),
        "inodes a step": round((grown.files + grown.folders) / steps, 2),
        "bytes a step": round(grown.bytes / steps),
        "disk KB a scene": round(grown.disk_bytes / 1e3 / result.options.scenes, 1),
    }


def _server_rows(result: ScaleResult, server: ServerGrowth) -> list[Row]:
    steps = result.options.steps
    scenes = result.options.scenes
    grown = server.bytes_after - server.bytes_before
    resident = [sample.server.rss for sample in result.samples]
    cpu_ms = round(1000 * server.cpu_s / steps, 1)
    rows: list[Row] = [
        {
            "what": "CPU",
            "in all": f"{server.cpu_s:.1f} s",
            "a task run": f"{cpu_ms} ms",
        },
        {
            "what": "database",
            "in all": f"{grown / _MB:.1f} MB",
            "a task run": f"{grown / steps / 1e3:.1f} KB",
        },
        {
            "what": "memory, first to largest",
            "in all": f"{resident[0] / _MB:.0f} to {max(resident) / _MB:.0f} MB",
            "a task run": "-",
        },
        {"what": "backlog at the end", "in all": f"{server.drain_s:.1f} s", "a task run": "-"},
    ]
    for table, count in sorted(server.rows.items(), key=lambda item: -item[1]):
        if count >= scenes:
            rows.append(
                {"what": f"rows of {table}", "in all": count, "a task run": round(count / steps, 2)}
            )
    return rows
