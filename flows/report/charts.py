"""Draw small line charts as inline SVG."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np
from jaxtyping import Float

WIDTH, HEIGHT, MARGIN = 420, 150, 38


@dataclass(frozen=True)
class Line:
    """One named curve of a chart."""

    name: str
    values: Float[np.ndarray, " t"]
    colour: str


def line_chart(x: Float[np.ndarray, " t"], lines: list[Line], x_unit: str, y_unit: str) -> str:
    """Return an SVG of the curves over ``x``, with the range of y written out."""
    top = max((float(np.max(line.values)) for line in lines), default=0.0)
    top = max(top, 1e-9) * 1.1
    span = max(float(x[-1] - x[0]), 1e-9)
    step = max(1, len(x) // 240)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" class="chart" role="img" '
        f'aria-label="{escape(", ".join(line.name for line in lines))}">',
        f'<path class="axis" d="M{MARGIN} 8V{HEIGHT - 24}H{WIDTH - 6}"/>',
        f'<text x="{MARGIN - 4}" y="16" text-anchor="end">{top:.3g}</text>',
        f'<text x="{MARGIN - 4}" y="30" text-anchor="end">{escape(y_unit)}</text>',
        f'<text x="{MARGIN - 4}" y="{HEIGHT - 24}" text-anchor="end">0</text>',
        f'<text x="{WIDTH - 6}" y="{HEIGHT - 8}" text-anchor="end">'
        f"{x[-1]:.3g} {escape(x_unit)}</text>",
    ]
    for i, line in enumerate(lines):
        px = MARGIN + (x[::step] - x[0]) / span * (WIDTH - MARGIN - 6)
        py = HEIGHT - 24 - line.values[::step] / top * (HEIGHT - 34)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
        parts.append(f'<polyline points="{points}" style="stroke:{line.colour}"/>')
        parts.append(
            f'<text x="{MARGIN + 10 + 120 * i}" y="{HEIGHT - 8}" style="fill:{line.colour}">'
            f"{escape(line.name)}</text>"
        )
    return "".join(parts) + "</svg>"
