"""Say what ``garden benchmark orchestration`` measures, and how much of it."""

from __future__ import annotations

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
