"""Draw when each step of a scene waited, loaded, computed and published, as inline SVG."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape

from flows.benchmark.latency.timing import PARTS, SceneTiming, StepTiming
from flows.benchmark.latency.totals import Span, busy_spans
from flows.report.charts import round_ticks

WIDTH, LEFT, RIGHT, TOP, BOTTOM = 1160.0, 130.0, 24.0, 8.0, 26.0
LANE, BAR = 30.0, 22.0
LETTER = 6.4
"""Width of a letter at the charts' font size."""

SCENE_LANE = "the scene"
HUE_TURN = 137.5
"""Degrees between the hues of one step and the next: neighbours differ most."""

START = "start"
"""What an isolated step takes besides: starting its process."""


@dataclass(frozen=True)
class Axis:
    """Seconds in which a step waited or worked; gaps with nothing going on are cut out."""

    spans: list[Span]
    top: float

    def seconds(self, moment: float) -> float:
        """Return how many such seconds there were before a moment in Unix seconds."""
        return sum(max(0.0, min(moment, end) - start) for start, end in self.spans)

    def x(self, moment: float) -> float:
        """Return where a moment is drawn."""
        return LEFT + (WIDTH - LEFT - RIGHT) * self.seconds(moment) / self.top


def drawn_seconds(timing: SceneTiming) -> float:
    """Return the seconds in which a step, rendering too, waited or worked."""
    spans = busy_spans(step.span for step in timing.steps if step.span is not None)
    return sum(end - start for start, end in spans)


def timeline(timing: SceneTiming, colours: Mapping[str, str], top: float | None = None) -> str:
    """Return a figure with one lane for the scene's own steps and one for each object.

    Its axis ends at ``top`` seconds (where the last step ends, if not given). Empty if no
    step has a time. A bar is stacked from waiting, starting a process, loading,
    computing and publishing; its title says the seconds. Rendering is dashed.
    """
    steps = [step for step in timing.steps if step.span is not None]
    if not steps:
        return ""
    spans = busy_spans(step.span for step in steps if step.span)
    whole = drawn_seconds(timing)
    axis = Axis(spans, max(top or whole, 1e-3))
    rows = list(_rows(steps, timing.objects))
    height = TOP + LANE * len(rows) + BOTTOM
    parts = [_grid(axis.top, height)]
    for i, (label, lane) in enumerate(rows):
        y = TOP + LANE * i
        parts.append(f'<text x="{LEFT - 8}" y="{y + 19}" text-anchor="end">{_short(label)}</text>')
        parts += [_bar(step, axis, y + (LANE - BAR) / 2, colours[step.step]) for step in lane]
    says = (
        f"{timing.scene}, {timing.mode}: {len(steps)} steps in {axis.seconds(spans[-1][1]):.3g} s"
    )
    return (
        f'<figure><svg viewBox="0 0 {WIDTH:g} {height:g}" class="chart timeline" role="img" '
        f'aria-label="{escape(says)}">{"".join(parts)}</svg>'
        f"<figcaption>{escape(says)}</figcaption></figure>"
    )


def step_colours(steps: Iterable[StepTiming]) -> dict[str, str]:
    """Return a colour for each step, in the order in which they first started."""
    ordered = sorted(steps, key=lambda step: step.started or 0.0)
    names = dict.fromkeys(step.step for step in ordered)
    return {name: f"hsl({(205 + i * HUE_TURN) % 360:.0f} 48% 42%)" for i, name in enumerate(names)}


def stacked_parts(step: StepTiming) -> list[tuple[str, float]]:
    """Return the parts of a step in the order in which they happen, with their seconds."""
    if step.seconds is None or step.span is None:
        return []
    start, end = step.span
    known = {part: getattr(step.seconds, part) for part in PARTS}
    rest = max(0.0, end - start - step.seconds.total)
    ordered = {"wait": known["wait"], START: rest, **{p: known[p] for p in PARTS if p != "wait"}}
    return [(name, value) for name, value in ordered.items() if value > 0]


def _rows(
    steps: list[StepTiming], objects: tuple[str, ...]
) -> Iterable[tuple[str, list[StepTiming]]]:
    """Give the lanes with their labels; steps of one lane that overlap get a lane each."""
    others = dict.fromkeys(s.target for s in steps if s.target and s.target not in objects)
    for target in ("", *objects, *others):
        lanes: list[list[StepTiming]] = []
        own = [(step.span, step) for step in steps if step.target == target]
        for span, step in sorted(own, key=lambda pair: pair[0] or (0.0, 0.0)):
            free = (lane for lane in lanes if _end(lane[-1]) <= (span or (0.0, 0.0))[0] + 1e-3)
            lane = next(free, None)
            if lane is None:
                lanes.append([step])
            else:
                lane.append(step)
        for i, lane in enumerate(lanes):
            yield (target or SCENE_LANE) if i == 0 else "", lane


def _end(step: StepTiming) -> float:
    return step.span[1] if step.span else 0.0


def _bar(step: StepTiming, axis: Axis, y: float, colour: str) -> str:
    if step.span is None or step.seconds is None:
        return ""
    start, end = step.span
    left, right = axis.x(start), axis.x(end)
    parts = stacked_parts(step)
    detail = ", ".join(f"{name} {value:.2f}" for name, value in parts)
    title = f"{step.name}: {end - start:.2f} s ({detail})"
    if step.peak_mb:
        title += f", peak {step.peak_mb:.0f} MB"
    kind = " left-out" if step.evaluation_only else ""
    drawn = [f'<g class="bar{kind}" style="--colour:{colour}"><title>{escape(title)}</title>']
    begun = start
    for name, value in parts:
        a, b = axis.x(begun), axis.x(min(begun + value, end))
        begun += value
        width = f"{max(b - a, 0.3):.2f}"
        drawn.append(f'<rect class="{name}" x="{a:.2f}" y="{y:g}" width="{width}" height="{BAR}"/>')
    if right - left > LETTER * len(step.step) + 8:
        drawn.append(
            f'<text x="{(left + right) / 2:.2f}" y="{y + 15:g}">{escape(step.step)}</text>'
        )
    return "".join(drawn) + "</g>"


def _grid(whole: float, height: float) -> str:
    drawn = []
    ticks = [tick for tick in round_ticks(whole) if tick <= whole]
    for tick in ticks:
        x = LEFT + (WIDTH - LEFT - RIGHT) * tick / whole
        unit = " s" if tick == ticks[-1] else ""
        drawn.append(f'<path class="grid" d="M{x:.1f} {TOP}V{height - BOTTOM + 4:g}"/>')
        text = f'<text x="{x:.1f}" y="{height - 8:g}" text-anchor="middle">{tick:g}{unit}</text>'
        drawn.append(text)
    return "".join(drawn)


def _short(label: str) -> str:
    most = int((LEFT - 12) / LETTER)
    return escape(label if len(label) <= most else label[: most - 1] + "…")
