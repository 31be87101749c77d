"""Read the options of ``garden benchmark orchestration``."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

PARTS = ("steps", "publishing", "scene", "scale")
SAMPLE = Path("tests/scenes/corner")


@dataclass(frozen=True)
class OrchestrationOptions:
    """What to measure, and how much of it."""

    parts: tuple[str, ...] = PARTS
    steps: int = 200
    repeats: int = 5
    gigabytes: float = 1.0
    scene: Path = SAMPLE
    scenes: int = 1000
    objects: int = 5
    engine: Literal["local", "prefect"] = "prefect"
    processes: int = 2
    server: Literal["full", "lean"] = "lean"
    out: Path | None = None


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that only orchestration takes, in a group of their own."""
    default = OrchestrationOptions()
    group = parser.add_argument_group("orchestration")
    group.add_argument(
        "--only", nargs="+", choices=PARTS, default=PARTS, help="measure these parts only"
    )
    group.add_argument("--steps", type=int, default=default.steps, help="steps of the chain (200)")
    group.add_argument("--repeats", type=int, default=default.repeats, help="repeats (5)")
    group.add_argument(
        "--gigabytes", type=float, default=default.gigabytes, help="arrays to publish (1)"
    )
    group.add_argument(
        "--scene", type=Path, default=default.scene, help="capture of the cold scene"
    )
    group.add_argument("--scenes", type=int, default=default.scenes, help="simulated scenes (1000)")
    group.add_argument("--objects", type=int, default=default.objects, help="objects a scene (5)")
    group.add_argument(
        "--processes", type=int, default=default.processes, help="simulated scenes at once (2)"
    )
    group.add_argument(
        "--server",
        choices=("lean", "full"),
        default=default.server,
        help="the Prefect server's settings for the simulated scenes: lean keeps no events",
    )


def from_arguments(arguments: argparse.Namespace) -> OrchestrationOptions:
    """Return what the user asked for."""
    return OrchestrationOptions(
        parts=tuple(arguments.only),
        steps=arguments.steps,
        repeats=arguments.repeats,
        gigabytes=arguments.gigabytes,
        scene=arguments.scene,
        scenes=arguments.scenes,
        objects=arguments.objects,
        engine=arguments.engine,
        processes=arguments.processes,
        server=arguments.server,
        out=arguments.out,
    )
