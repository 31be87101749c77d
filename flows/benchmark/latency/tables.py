"""Lay a report's numbers out as tables of text, for the Markdown and the page alike."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from flows.benchmark.latency.machine import Machine
from flows.benchmark.latency.percentiles import median
from flows.benchmark.latency.timing import MODES, PARTS

Json = dict[str, Any]
NONE = "–"
_MODE_NAMES = tuple(name for mode in MODES for name in (f"{mode} p50", f"{mode} p95"))


@dataclass(frozen=True)
class Table:
    """A table with a heading and what one must know to read it; texts come before numbers."""

    title: str
    note: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    texts: int = 1

    def known(self) -> Table:
        """Return the table without columns that say nothing in any row."""
        kept = [
            i
            for i in range(len(self.header))
            if not self.rows or any(row[i] != NONE for row in self.rows)
        ]
        header, *rows = (tuple(line[i] for i in kept) for line in (self.header, *self.rows))
        return dataclasses.replace(self, header=header, rows=tuple(rows))


def all_tables(document: Json) -> list[Table]:
    """Return the report's tables, those that nothing is known for left out."""
    tables = (scene_table, step_table, object_table, ours_table, paper_table)
    return [table for make in tables if (table := make(document)).rows]


def scene_table(document: Json) -> Table:
    """Return the scenes' seconds in each mode, the slowest first."""
    header = ["scene", "objects", *_MODE_NAMES]
    header += ["cold wall", "cold process", "cached process", "render", "peak MB", *PARTS]
    rows = [_scene_row(scene) for scene in by_seconds(document["scenes"])]
    over = [document["over_scenes"][mode] for mode in MODES]
    if len(rows) > 1:
        cells = [cell for found in over for cell in _pair(found)]
        rows.append(("all scenes", NONE, *cells, *[NONE] * (len(header) - 2 - len(cells))))
    return Table(
        "Scenes",
        "Seconds without rendering. p50 and p95 of a scene are over its repetitions, those of "
        "all scenes over the scenes. Wall adds what goes on between steps; process also adds "
        "the start of Python and the writing of the package. Rendering, memory and shares are of "
        "cold runs.",
        tuple(header),
        tuple(rows),
    ).known()


def _scene_row(scene: Json) -> tuple[str, ...]:
    cold = scene["modes"]["cold"]
    cells = [cell for mode in MODES for cell in _pair(scene["modes"][mode])]
    return (
        scene["scene"],
        str(scene["objects"]),
        *cells,
        seconds(cold["wall_s"]),
        seconds(cold["process_s"]),
        seconds(scene["modes"]["cached"]["process_s"]),
        seconds(cold["render_s"]),
        megabytes(cold["peak_mb"]),
        *_shares(cold["shares"]),
    )


def step_table(document: Json) -> Table:
    """Return every step's seconds over all scenes and objects."""
    header = ("step", "calls", *_MODE_NAMES)
    rows = []
    for step in document["steps"]:
        note = " (left out of totals)" if step["evaluation_only"] else ""
        cold = step["modes"]["cold"]
        cells = [cell for mode in MODES for cell in _pair(step["modes"][mode])]
        rows.append(
            (
                step["step"] + note,
                str(step["calls"]),
                *cells,
                megabytes(cold["peak_mb"]),
                *_shares(cold["shares"]),
            )
        )
    return Table(
        "Steps",
        "Seconds of one execution, or look-up; each scene and object counts once, with its "
        "median over repetitions; a single call has those over its repetitions. Memory and "
        "shares are of cold runs.",
        (*header, "peak MB", *PARTS),
        tuple(rows),
    ).known()


def object_table(document: Json) -> Table:
    """Return the seconds of each object's own steps."""
    rows = []
    for scene in by_seconds(document["scenes"]):
        for entry in scene["by_object"]:
            cold = entry["modes"]["cold"]
            cells = [cell for mode in MODES for cell in _pair(entry["modes"][mode])]
            names = (entry["object"], scene["scene"])
            rows.append((*names, *cells, megabytes(cold["peak_mb"]), *_shares(cold["shares"])))
    return Table(
        "Objects",
        "Seconds of the steps that belong to one object alone, added up; objects of one scene "
        "overlap in time.",
        ("object", "scene", *_MODE_NAMES, "peak MB", *PARTS),
        tuple(rows),
        texts=2,
    ).known()


def paper_table(document: Json) -> Table:
    """Return the paper's table."""
    theirs = document["paper"]
    return Table(
        "The paper's scenes",
        f"Seconds without rendering from {theirs['source']}, on {theirs['hardware']}; "
        f"{theirs['objects']}.",
        ("scene", "LiteReality", "GARDEN (paper)", "ratio"),
        tuple(
            (s["scene"], f"{s['litereality_s']:g}", f"{s['garden_s']:g}", f"{s['ratio']:.1f}")
            for s in theirs["scenes"]
        ),
    )


def ours_table(document: Json) -> Table:
    """Return our cold seconds to stand beside the paper's, a scene and an object."""
    rows = [
        (
            scene["scene"],
            str(scene["objects"]),
            seconds(scene["modes"]["cold"]["p50_s"]),
            seconds(scene["modes"]["cold"]["per_object_s"]),
            seconds(_own_seconds(scene)),
        )
        for scene in by_seconds(document["scenes"])
    ]
    return Table(
        "Our scenes, to stand beside them",
        f"Cold seconds without rendering, on {hardware(document)} Not a like-for-like "
        "comparison: the scenes, photos, number of objects, backends and hardware differ. Seconds "
        "an object divide the scene's by its objects; own steps are the median "
        "over its objects of what each adds by itself.",
        ("scene", "objects", "cold", "cold an object", "own steps an object"),
        tuple(rows),
    )


def hardware(document: Json) -> str:
    """Return on what the scenes were executed, as far as it is known here."""
    here = Machine(**{**document["machine"], "gpus": tuple(document["machine"]["gpus"])})
    hosts = sorted({host for scene in document["scenes"] for host in scene["hosts"]})
    others = [host for host in hosts if host != here.host]
    if others:
        return (
            f"{', '.join(hosts)}; of {', '.join(others)} only the name is known, this report was "
            f"made on {here.host}: {here.line()}."
        )
    return f"{here.line()} ({here.host})."


def _own_seconds(scene: Json) -> float | None:
    return median(entry["modes"]["cold"]["p50_s"] for entry in scene["by_object"])


def by_seconds(scenes: list[Json]) -> list[Json]:
    """Return the scenes, the slowest first and those without a cold total last."""
    return sorted(scenes, key=lambda scene: -(scene["modes"]["cold"]["p50_s"] or 0.0))


def seconds(value: float | None) -> str:
    """Return seconds with three digits that count (two below 10 ms)."""
    if value is None:
        return NONE
    if value >= 100:
        return f"{value:.0f}"
    if value >= 10:
        return f"{value:.1f}"
    if value >= 1:
        return f"{value:.2f}"
    return f"{value:.3f}" if value >= 0.01 or value == 0 else f"{value:.2g}"


def megabytes(value: float | None) -> str:
    """Return whole MB."""
    return NONE if value is None else f"{value:.0f}"


def _pair(found: Json) -> tuple[str, str]:
    """Return p50 and p95; a single value has no 95th percentile to speak of."""
    return seconds(found["p50_s"]), seconds(found["p95_s"]) if found["count"] > 1 else NONE


def _shares(shares: dict[str, float]) -> tuple[str, ...]:
    return tuple(f"{100 * shares[part]:.0f} %" if part in shares else NONE for part in PARTS)
