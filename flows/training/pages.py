"""Write pages about trainings: curves, tables, confusion pictures, augmentations."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from flows.report.charts import round_ticks
from flows.report.pictures import figure

Picture = UInt8[np.ndarray, "h w 3"]
WIDTH, HEIGHT, LEFT, BOTTOM = 640, 220, 52, 26


def page(title: str, parts: Sequence[str]) -> str:
    """Return a page that opens alone in a browser."""
    style = files("flows.report").joinpath("page.css").read_text("utf-8")
    return (
        "<!doctype html><html lang=en><meta charset=utf-8>"
        '<meta name=viewport content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style>"
        f"<main><h1>{escape(title)}</h1>{''.join(parts)}</main></html>"
    )


def section(title: str, *parts: str) -> str:
    """Return a part of the page with a heading."""
    return f'<section><h2>{escape(title)}</h2><div class="card">{"".join(parts)}</div></section>'


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as a table; numbers to the right."""
    if not rows:
        return ""
    names = list(dict.fromkeys(name for row in rows for name in row))
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = "".join(
        "<tr>" + "".join(_cell(row.get(name, "")) for name in names) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table><tr>{head}</tr>{body}</table></div>'


def facts(values: dict[str, Any]) -> str:
    """Return short facts as a list of names and values."""
    items = "".join(
        f"<div>{escape(name)}<b>{escape(str(value))}</b></div>" for name, value in values.items()
    )
    return f'<div class="facts">{items}</div>'


def loss_chart(losses: Float[np.ndarray, " s"], smoothed: int = 25) -> str:
    """Return the loss over steps as SVG: thin as it was, thick as a running mean."""
    if not len(losses):
        return "<p>no step was made</p>"
    ticks = round_ticks(float(np.quantile(losses, 0.995)))
    px = LEFT + np.arange(len(losses)) / max(len(losses) - 1, 1) * (WIDTH - LEFT - 10)
    window = min(smoothed, len(losses))
    mean = np.convolve(losses, np.full(window, 1 / window), mode="valid")
    curves: list[tuple[np.ndarray, np.ndarray, str]] = [
        (px, losses, "opacity:.35;stroke:#67727b"),
        (px[window - 1 :], mean, "stroke:#c4562a;stroke-width:2.2"),
    ]
    drawn = []
    for tick in ticks:
        at = 10 + (HEIGHT - BOTTOM - 10) * (1 - tick / ticks[-1])
        drawn.append(f'<path class="grid" d="M{LEFT} {at:.1f}H{WIDTH - 10}"/>')
        drawn.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for x, values, style in curves:
        y = 10 + (HEIGHT - BOTTOM - 10) * (1 - np.minimum(values / ticks[-1], 1.02))
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
        drawn.append(f'<polyline points="{points}" style="{style}"/>')
    end = f'<text x="{WIDTH - 10}" y="{HEIGHT - 6}" text-anchor="end">step {len(losses)}</text>'
    return (
        f'<figure><svg viewBox="0 0 {WIDTH} {HEIGHT}" class="chart" role="img" '
        f'aria-label="loss over steps">{"".join(drawn)}{end}</svg>'
        f"<figcaption>loss over steps; the last {window} on average {mean[-1]:.4f}</figcaption>"
        "</figure>"
    )


def pictures(named: dict[str, Picture], caption: str = "") -> str:
    """Return a row of pictures with captions."""
    row = "".join(
        figure(rgb, name, f"{caption} {name}".strip(), 300) for name, rgb in named.items()
    )
    return f'<p class="dim">{escape(caption)}</p><div class="row strip">{row}</div>'


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f'<td class="n">{value:.4f}</td>'
    return f"<td>{escape(str(value))}</td>"
