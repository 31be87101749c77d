"""Measure the parts that were asked for, one after the other, each in a folder of its own."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from flows.benchmark.orchestration.cost import (
    publishing_section,
    scene_section,
    step_section,
)
from flows.benchmark.orchestration.options import OrchestrationOptions
from flows.benchmark.orchestration.peers.all_peers import PEERS, check_installed
from flows.benchmark.orchestration.pipeline import CHAINS
from flows.benchmark.orchestration.report import BenchmarkReport, Section

Say = Callable[[str], None]


def measure_all(options: OrchestrationOptions, folder: Path, say: Say) -> BenchmarkReport:
    """Return the report; everything that is written meanwhile lies below ``folder``.

    Raises PeerMissing before anything is measured, WrongResult, SceneFailed.
    """
    if "steps" in options.parts:
        check_installed(PEERS)
    report = BenchmarkReport()
    for part in options.parts:
        with _room(folder, part) as room:
            report.sections += _MEASURE[part](options, room, say)
    return report


def _steps(options: OrchestrationOptions, folder: Path, say: Say) -> list[Section]:
    from flows.benchmark.orchestration.step_cost import measure_steps

    chains = tuple(replace(chain, length=options.steps) for chain in CHAINS.values())
    costs = measure_steps(chains, folder, repeats=options.repeats, say=say)
    return [
        step_section(chain.name, chain.length, [c for c in costs if c.chain == chain.name])
        for chain in chains
    ]


def _publishing(options: OrchestrationOptions, folder: Path, say: Say) -> list[Section]:
    from flows.benchmark.orchestration.publishing import GIGABYTE, measure_publishing

    say(f"publishing {options.gigabytes:g} GB, {options.repeats} times")
    size = int(options.gigabytes * GIGABYTE)
    return [publishing_section(measure_publishing(folder, size, options.repeats))]


def _scene(options: OrchestrationOptions, folder: Path, say: Say) -> list[Section]:
    from flows.benchmark.orchestration.scene_overhead import measure_scene

    say(f"factorizing {options.scene} from an empty store")
    return [scene_section(measure_scene(options.scene, folder))]


def _scale(options: OrchestrationOptions, folder: Path, say: Say) -> list[Section]:
    from flows.benchmark.orchestration.scale import ScaleOptions, measure_scale
    from flows.benchmark.orchestration.scale_report import scale_sections

    say(f"{options.scenes} simulated scenes of {options.objects} objects ({options.engine})")
    scale = ScaleOptions(
        options.scenes, options.objects, options.engine, options.processes, options.server
    )
    return scale_sections(measure_scale(scale, folder, say))


_MEASURE: dict[str, Callable[[OrchestrationOptions, Path, Say], list[Section]]] = {
    "steps": _steps,
    "publishing": _publishing,
    "scene": _scene,
    "scale": _scale,
}


@contextmanager
def _room(folder: Path, part: str) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix=f"{part}-", dir=folder) as name:
        yield Path(name)
