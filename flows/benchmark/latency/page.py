"""Write a latency report as one HTML file that opens alone in a browser."""

from __future__ import annotations

from html import escape
from importlib.resources import files
from typing import Any

from flows.benchmark.latency.document import Measured
from flows.benchmark.latency.markdown import intro
from flows.benchmark.latency.tables import (
    Table,
    by_seconds,
    object_table,
    ours_table,
    paper_table,
    scene_table,
    seconds,
    step_table,
)
from flows.benchmark.latency.timeline import START, drawn_seconds, step_colours, timeline
from flows.benchmark.latency.timing import Mode

Json = dict[str, Any]

OPEN_TIMELINES = 10
"""Scenes whose timelines are unfolded; the slowest come first."""

DRAWN: tuple[Mode, ...] = ("cold", "warm")


def latency_page(document: Json, measured: Measured) -> str:
    """Return the whole page."""
    parts = [
        "<h1>Latency</h1>",
        *(f'<p class="dim">{escape(line)}</p>' for line in intro(document)),
        _facts(document),
        _definitions(document),
        _absent(document),
        _section("scenes", scene_table(document)),
        _timelines(document, measured),
        _section("steps", step_table(document)),
        _section("objects", object_table(document)),
        _beside_the_paper(document),
    ]
    style = files("flows.report").joinpath("page.css").read_text("utf-8")
    style += files("flows.benchmark.latency").joinpath("page.css").read_text("utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,"><title>Latency · GARDEN</title>'
        f"<style>{style}</style></head><body><main>{''.join(parts)}</main></body></html>\n"
    )


def _facts(document: Json) -> str:
    over = document["over_scenes"]
    objects = sum(scene["objects"] for scene in document["scenes"])
    facts = [("scenes", str(len(document["scenes"]))), ("objects", str(objects))]
    for mode, found in over.items():
        if found["count"]:
            facts.append((f"{mode}, median of scenes", f"{seconds(found['p50_s'])} s"))
    cells = "".join(f"<div><b>{escape(value)}</b>{escape(name)}</div>" for name, value in facts)
    return f'<div class="facts">{cells}</div>'


def _definitions(document: Json) -> str:
    lines = "".join(
        f"<p><b>{escape(mode)}</b>: {escape(text)}.</p>"
        for mode, text in document["definitions"].items()
    )
    return f'<section id="definitions">{lines}</section>'


def _absent(document: Json) -> str:
    if not document["absent"]:
        return ""
    lines = "".join(f"<p>{escape(line)}</p>" for line in document["absent"])
    return f'<section id="absent"><h2>Absent</h2><div class="card">{lines}</div></section>'


def _section(name: str, table: Table) -> str:
    if not table.rows:
        return ""
    body = f'<p class="dim">{escape(table.note)}</p><div class="card scroll">{_html(table)}</div>'
    return f'<section id="{name}"><h2>{escape(table.title)}</h2>{body}</section>'


def _beside_the_paper(document: Json) -> str:
    cards = "".join(
        f'<div class="card scroll"><h3>{escape(table.title)}</h3>'
        f'<p class="dim">{escape(table.note)}</p>{_html(table)}</div>'
        for table in (ours_table(document), paper_table(document))
    )
    return (
        '<section id="paper"><h2>Beside the paper</h2>'
        f'<div class="row beside">{cards}</div></section>'
    )


def _html(table: Table) -> str:
    kinds = ["" if i < table.texts else ' class="n"' for i in range(len(table.header))]

    def line(cells: tuple[str, ...], tag: str) -> str:
        inner = (f"<{tag}{k}>{escape(c)}</{tag}>" for c, k in zip(cells, kinds, strict=True))
        return f"<tr>{''.join(inner)}</tr>"

    body = "".join(line(row, "td") for row in table.rows)
    return f"<table>{line(table.header, 'th')}{body}</table>"


def _timelines(document: Json, measured: Measured) -> str:
    cards = []
    colours = step_colours(step for timing in measured.timings for step in timing.steps)
    legend = _legend(colours)
    for i, scene in enumerate(by_seconds(document["scenes"])):
        name = scene["scene"]
        drawn = [t for mode in DRAWN for t in measured.of(mode, name)[:1]]
        top = max((drawn_seconds(timing) for timing in drawn), default=0.0)
        figures = "".join(timeline(timing, colours, top) for timing in drawn)
        if figures:
            unfolded = " open" if i < OPEN_TIMELINES else ""
            cards.append(
                f'<details class="card"{unfolded}><summary>{escape(name)}</summary>{figures}'
                f"{legend}</details>"
            )
    if not cards:
        return ""
    return (
        '<section id="timelines"><h2>Timelines</h2><p class="dim">One lane for the scene\'s own '
        "steps and one for each object. Time in which no step ran is cut out. Rendering, which "
        "totals leave out, is dashed. Point at a bar for its seconds.</p>"
        f"{''.join(cards)}</section>"
    )


def _legend(colours: dict[str, str]) -> str:
    keys = [
        f'<span><i class="key" style="--colour:{colour}"></i>{escape(name)}</span>'
        for name, colour in colours.items()
    ]
    keys += [
        f'<span><i class="key {part}"></i>{text}</span>'
        for part, text in (
            ("wait", "waiting"),
            (START, "starting a process"),
            ("load", "loading"),
            ("compute", "computing"),
            ("publish", "publishing"),
        )
    ]
    return f'<div class="legend">{"".join(keys)}</div>'
