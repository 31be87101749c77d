"""Write what was measured as text for the terminal, Markdown and JSON."""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from flows.benchmark.measure import Measure

Row = dict[str, Any]
PACKAGES = ("prefect", "zarr", "joblib", "redun", "numpy")


def machine_facts() -> dict[str, str]:
    """Return what figures of time depend on: system, cores, Python, packages."""
    facts = {
        "system": f"{platform.system()} {platform.machine()}",
        "cores": str(len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()),
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            continue
    return facts


@dataclass(frozen=True)
class Section:
    """One part of the benchmark: a table, how it was measured, and what has to hold."""

    title: str
    method: str
    rows: list[Row]
    claims: tuple[Measure, ...] = ()


@dataclass
class BenchmarkReport:
    """All parts that were measured, and on what."""

    sections: list[Section] = field(default_factory=list)
    machine: dict[str, str] = field(default_factory=machine_facts)

    @property
    def claims(self) -> list[Measure]:
        """All that has to hold."""
        return [claim for section in self.sections for claim in section.claims]

    @property
    def holds(self) -> bool:
        """Whether all of it does."""
        return all(claim.holds for claim in self.claims)

    def to_json(self) -> dict[str, Any]:
        """Return one JSON document."""
        return {
            "benchmark": "orchestration",
            "machine": self.machine,
            "holds": self.holds,
            "sections": [
                {
                    "title": section.title,
                    "method": section.method,
                    "rows": section.rows,
                    "claims": [
                        {**dataclasses.asdict(claim), "holds": claim.holds}
                        for claim in section.claims
                    ],
                }
                for section in self.sections
            ],
        }

    def to_text(self) -> str:
        """Return the tables, and the claims below them."""
        parts = [f"{s.title}\n\n{text_table(s.rows)}\n\n{s.method}\n" for s in self.sections]
        return "\n".join([*parts, *(claim.line() for claim in self.claims)])

    def to_markdown(self) -> str:
        """Return a page."""
        facts = ", ".join(f"{name} {value}" for name, value in self.machine.items())
        parts = [f"# garden benchmark orchestration\n\nMeasured on {facts}.\n"]
        for section in self.sections:
            parts.append(f"## {section.title}\n\n{section.method}\n\n{markdown(section.rows)}\n")
            if section.claims:
                lines = "\n".join(claim.line() for claim in section.claims)
                parts.append(f"```\n{lines}\n```\n")
        return "\n".join(parts)

    def write(self, folder: Path) -> None:
        """Write ``orchestration.json`` and ``orchestration.md`` into ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        document = json.dumps(self.to_json(), indent=1) + "\n"
        (folder / "orchestration.json").write_text(document, "utf-8")
        (folder / "orchestration.md").write_text(self.to_markdown(), "utf-8")


def text_table(rows: list[Row]) -> str:
    """Return rows as columns of text."""
    return _table(rows, lambda cells, widths: "  ".join(_aligned(cells, widths)).rstrip())


def markdown(rows: list[Row]) -> str:
    """Return rows as a Markdown table."""
    lines = _table(rows, lambda cells, widths: f"| {' | '.join(_aligned(cells, widths))} |")
    head, *rest = lines.split("\n")
    rule = "|".join("---" for _ in rows[0]) if rows else ""
    return "\n".join([head, f"|{rule}|", *rest])


def _table(rows: list[Row], line: Callable[[list[str], list[int]], str]) -> str:
    if not rows:
        return "nothing was measured"
    header = list(rows[0])
    cells = [header, *([_shown(row[name]) for name in header] for row in rows)]
    widths = [max(len(row[index]) for row in cells) for index in range(len(header))]
    return "\n".join(line(row, widths) for row in cells)


def _aligned(cells: list[str], widths: list[int]) -> list[str]:
    return [cell.ljust(width) for cell, width in zip(cells, widths, strict=True)]


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
