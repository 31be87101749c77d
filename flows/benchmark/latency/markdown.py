"""Write a latency report as Markdown."""

from __future__ import annotations

from typing import Any

from flows.benchmark.latency.tables import Table, all_tables, hardware

Json = dict[str, Any]


def latency_markdown(document: Json) -> str:
    """Return the whole report."""
    parts = ["# Latency", *intro(document)]
    parts += ["## What the modes mean", "\n".join(definition_lines(document))]
    if document["absent"]:
        parts += ["## Absent", "\n".join(f"- {_safe(line)}" for line in document["absent"])]
    for table in all_tables(document):
        parts += [f"## {table.title}", table.note, _table(table)]
    return "\n\n".join(parts) + "\n"


def intro(document: Json) -> list[str]:
    """Return what was measured, when, and on what."""
    return [
        f"{document['source']} Made {document['made']}.",
        f"Executed on {hardware(document)}",
    ]


def definition_lines(document: Json) -> list[str]:
    """Return one line a mode."""
    return [f"- *{mode}*: {text}." for mode, text in document["definitions"].items()]


def _table(table: Table) -> str:
    rule = ["---" if i < table.texts else "---:" for i in range(len(table.header))]
    lines = [table.header, rule, *table.rows]
    return "\n".join("| " + " | ".join(_safe(cell) for cell in line) + " |" for line in lines)


def _safe(text: str) -> str:
    """Return a text that stays in its cell and is no markup."""
    for sign in "\\|<>*_`[]":
        text = text.replace(sign, f"\\{sign}")
    return " ".join(text.split())
