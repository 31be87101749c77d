"""Write what models cost as text, Markdown and JSON."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.benchmark.latency.machine import this_machine
from flows.benchmark.models.measure import Measured
from flows.benchmark.orchestration.report import markdown, text_table

METHOD = """\
Each line loads the model twice, in fresh processes: bare (the adapter in a plain loop) and
through GARDEN (a step in a store, the keeper, a worker, the answer checked and published).
Seconds are for all photos once: the median of the repeats after the first."""


@dataclass(frozen=True)
class ModelsReport:
    """All that was measured, and what could not be, with the reason."""

    size: tuple[int, int]
    random: bool
    measured: tuple[Measured, ...]
    failed: dict[str, str]

    def to_json(self) -> dict[str, Any]:
        """Return one JSON document."""
        return {
            "benchmark": "models",
            "machine": dataclasses.asdict(this_machine()),
            "size": list(self.size),
            "random_weights": self.random,
            "measured": [dataclasses.asdict(m) for m in self.measured],
            "failed": self.failed,
        }

    def to_text(self) -> str:
        """Return the table for a terminal."""
        return "\n".join([self._head(), "", text_table(self._rows()), "", *self._failures()])

    def to_markdown(self) -> str:
        """Return a page."""
        parts = ["# garden benchmark models", self._head(), METHOD, markdown(self._rows())]
        return "\n\n".join([*parts, *self._failures()]) + "\n"

    def write(self, folder: Path) -> None:
        """Write ``models.json`` and ``models.md`` into ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        document = json.dumps(self.to_json(), indent=1) + "\n"
        (folder / "models.json").write_text(document, "utf-8")
        (folder / "models.md").write_text(self.to_markdown(), "utf-8")

    def _rows(self) -> list[dict[str, Any]]:
        return [m.row() for m in self.measured]

    def _head(self) -> str:
        weights = "random weights" if self.random else "the machine's weights"
        width, height = self.size
        return f"Photos of {width} x {height} pixels, {weights}; {this_machine().line()}."

    def _failures(self) -> list[str]:
        return [f"{what}: {why}" for what, why in self.failed.items()]
