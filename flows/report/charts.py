"""Draw small line charts as inline SVG."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np
from jaxtyping import Float

WIDTH, HEIGHT = 440, 150
TOP, BOTTOM, LEFT, RIGHT = 12, 26, 48, 14
LETTER = 6.2
"""Width of a digit at the charts' font size, in the SVG's own units."""

PARTS = {1: 2, 2: 2, 3: 3, 4: 2, 5: 5, 6: 3, 8: 2, 10: 2}
"""Tops of an axis, and into how many parts ticks divide it."""


@dataclass(frozen=True)
class Line:
    """A curve: what it shows, its unit, and the least range that its axis spans.

    The floor keeps what is no motion at all, a hundredth of a millimetre, from filling the
    chart.
    """

    name: str
    unit: str
    values: Float[np.ndarray, " t"]
    colour: str
    floor: float


def line_chart(times_s: Float[np.ndarray, " t"], line: Line) -> str:
    """Return a figure of the curve over time, with round ticks and a caption."""
    known = np.isfinite(line.values)  # a simulation that blew up ends in no numbers
    largest = float(np.max(line.values[known], initial=0.0))
    ticks = round_ticks(max(largest, line.floor))
    labels = [f"{tick:g}" for tick in ticks]
    unit = line.unit if line.unit == "°" else f" {line.unit}"
    labels[-1] += unit
    left = max(LEFT, 10 + LETTER * max(len(label) for label in labels))
    inner_width, inner_height = WIDTH - left - RIGHT, HEIGHT - TOP - BOTTOM
    span = max(float(times_s[-1] - times_s[0]), 1e-9)
    parts = []
    for tick, label in zip(ticks, labels, strict=True):
        y = TOP + inner_height * (1 - tick / ticks[-1])
        parts.append(f'<path class="grid" d="M{left:.1f} {y:.1f}H{WIDTH - RIGHT}"/>')
        parts.append(_text(left - 5, y + 4, "end", label))
    for share, anchor, word in ((0.0, "middle", ""), (0.5, "middle", ""), (1.0, "end", " s")):
        x = left + inner_width * share
        parts.append(_text(x, HEIGHT - 8, anchor, f"{share * span:.3g}{word}"))
    step = max(1, len(times_s) // 240)
    px = left + (times_s[known][::step] - times_s[0]) / span * inner_width
    py = TOP + (1 - line.values[known][::step] / ticks[-1]) * inner_height
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
    parts.append(f'<polyline points="{points}" style="stroke:{line.colour}"/>')
    most = bounded(largest, line.floor / 100)
    says = f"{line.name} {most}{unit} from the start at any time in {span:.3g} s"
    return (
        f'<figure><svg viewBox="0 0 {WIDTH} {HEIGHT}" class="chart" role="img" '
        f'aria-label="{escape(says)}">{"".join(parts)}</svg>'
        f"<figcaption>{escape(says)}</figcaption></figure>"
    )


def round_ticks(top: float) -> list[float]:
    """Return evenly spaced round numbers from 0 to the first one not below ``top``."""
    exponent = float(np.floor(np.log10(top)))
    tops = [float(f"{mantissa * 10.0**exponent:.6g}") for mantissa in PARTS]
    end, parts = next(
        (end, parts)
        for end, parts in zip(tops, PARTS.values(), strict=True)
        if end >= top * (1 - 1e-9)
    )
    return [float(f"{end * i / parts:.6g}") for i in range(parts + 1)]


def bounded(value: float, least: float) -> str:
    """Say how large a value was at most, no finer than ``least``, below which it is nothing."""
    return f"less than {least:.1g}" if value < least else f"at most {value:.3g}"


def _text(x: float, y: float, anchor: str, text: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
