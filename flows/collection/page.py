"""Write ``collection.html``: every scene with its picture, verdict and times, worst first."""

from __future__ import annotations

import time
from html import escape, unescape
from importlib.resources import files
from urllib.parse import quote

from flows.collection.overview import counts, duration, model_lines
from flows.collection.row import WORST_FIRST, SceneRow
from flows.collection.state import PAGE, CollectionState, write_beside
from flows.collection.thumbnail import thumbnails

REASONS_SHOWN = 6
COLOURS = (
    "#4e79a7", "#f28e2b", "#76b7b2", "#e15759", "#59a14f", "#edc948", "#b07aa1", "#9c755f",
    "#ff9da7", "#a0cbe8", "#bab0ac", "#d37295", "#8cd17d",
)  # fmt: skip


def write_page(state: CollectionState) -> None:
    """Write the page beside the state; PackageError if it cannot be written."""
    write_beside(state.out / PAGE, collection_page(state))


def collection_page(state: CollectionState) -> str:
    """Return the page: one file that opens alone in a browser, without a network."""
    rows = sorted(state.rows.values(), key=lambda row: (WORST_FIRST.index(row.status), row.name))
    colours = _step_colours(rows)
    longest = max((sum(row.step_seconds.values()) for row in rows), default=0.0)
    scenes = "".join(_scene(row, state, colours, longest) for row in rows)
    style = files("flows.report").joinpath("page.css").read_text("utf-8")
    style += files("flows.collection").joinpath("page.css").read_text("utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{escape(state.name)} · GARDEN</title>'
        f"<style>{style}</style></head><body><main>{_head(state)}"
        f"{_legend(colours)}{scenes}</main></body></html>\n"
    )


def _head(state: CollectionState) -> str:
    known = counts(state)
    facts = [("scenes", str(len(state.rows)))]
    facts += [(status, str(known[status])) for status in WORST_FIRST if status in known]
    given = sum(row.objects[0] for row in state.rows.values() if row.objects)
    factored = sum(row.objects[1] for row in state.rows.values() if row.objects)
    if given:
        facts.append(("objects factored out", f"{factored} of {given}"))
    computed = sum(sum(row.step_seconds.values()) for row in state.rows.values())
    if computed:
        facts.append(("computed in all steps", duration(computed)))
    cells = "".join(f"<div><b>{value}</b>{name}</div>" for name, value in facts)
    started = time.strftime("%Y-%m-%d %H:%M", time.localtime(state.started))
    lasted = duration(max(state.updated - state.started, 0.0))
    remarks = "".join(f'<p class="dim">{escape(remark)}</p>' for remark in state.remarks)
    models = "".join(f'<p class="dim">{escape(line)}</p>' for line in model_lines(state))
    return (
        f"<h1>{escape(state.name)}</h1>"
        f'<p class="dim">Last batch: {escape(state.phase)}, started {started}, {lasted}. '
        f'Worst scenes first.</p><div class="facts">{cells}</div>{models}{remarks}'
    )


def _scene(row: SceneRow, state: CollectionState, colours: dict[str, str], longest: float) -> str:
    name = escape(row.name)
    if row.package is not None:
        name = f'<a href="{quote(row.package)}/report.html">{name}</a>'
    badge = f'<span class="verdict {row.status}">{row.status}</span>'
    return (
        f'<section class="card scene">{_pictures(row, state)}<div><h2>{name} {badge}</h2>'
        f'<p class="dim">{escape(_facts(row))}</p>{_reasons(row)}'
        f"{_bar(row.step_seconds, colours, longest)}</div></section>"
    )


def _pictures(row: SceneRow, state: CollectionState) -> str:
    found = thumbnails(state.out / row.package) if row.package is not None else []
    pictures = "".join(
        f'<img loading="lazy" src="{uri}" alt="{escape(unescape(alt))}">' for uri, alt in found
    )
    return f'<div class="pictures">{pictures or "<div class=none>no picture</div>"}</div>'


def _facts(row: SceneRow) -> str:
    facts = []
    if row.photos:
        facts.append(f"{row.photos[1]} of {row.photos[0]} photos registered")
    if row.objects:
        given, factored = row.objects
        facts.append(f"{factored} of {given} objects" if given else "no targets")
    if row.seconds:
        facts.append(f"{duration(row.seconds)} in its last run")
    if row.executed or row.cached:
        facts.append(f"{row.executed} steps executed, {row.cached} found in the store")
    if row.peak_mb:
        facts.append(f"peak {row.peak_mb / 1000:.1f} GB")
    return " · ".join(facts)


def _reasons(row: SceneRow) -> str:
    shown = "".join(f"<li>{escape(reason)}</li>" for reason in row.reasons[:REASONS_SHOWN])
    hidden = len(row.reasons) - REASONS_SHOWN
    more = f'<li class="dim">and {hidden} more, in its report</li>' if hidden > 0 else ""
    return f"<ul>{shown}{more}</ul>" if shown else ""


def _step_colours(rows: list[SceneRow]) -> dict[str, str]:
    """Give every step a colour, in the order in which steps first appear."""
    steps = dict.fromkeys(step for row in rows for step in row.step_seconds)
    return {step: COLOURS[i % len(COLOURS)] for i, step in enumerate(steps)}


def _bar(step_seconds: dict[str, float], colours: dict[str, str], longest: float) -> str:
    """Return the steps' seconds side by side; the longest scene's fill the width."""
    total = sum(step_seconds.values())
    if not total or not longest:
        return ""
    parts = "".join(
        f'<span style="width:{100 * seconds / longest:.2f}%;background:{colours[step]}" '
        f'title="{escape(step)} {seconds:.1f} s"></span>'
        for step, seconds in step_seconds.items()
        if seconds > 0
    )
    return (
        f'<div class="bar" role="img" aria-label="seconds by step">{parts}</div>'
        f'<p class="dim">{duration(total)} computed</p>'
    )


def _legend(colours: dict[str, str]) -> str:
    keys = "".join(
        f'<span><i style="background:{colour}"></i>{escape(step)}</span>'
        for step, colour in colours.items()
    )
    return f'<div class="legend">{keys}</div>' if keys else ""
