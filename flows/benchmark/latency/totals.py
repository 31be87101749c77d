"""Add up a scene's and an object's steps, with evaluation-only rendering left out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from flows.benchmark.latency.timing import PARTS, SceneTiming, StepTiming

Span = tuple[float, float]


@dataclass(frozen=True)
class Totals:
    """What some steps took together, in seconds.

    ``work`` is the sum over the steps, ``elapsed`` the time in which at least one of them
    waited or worked (steps of different objects overlap); ``parts`` divides ``work`` into
    load, compute, publish and wait, ``render`` is the rendering that was left out.
    """

    work: float
    elapsed: float | None
    parts: dict[str, float]
    render: float
    peak_mb: float | None

    @property
    def shares(self) -> dict[str, float]:
        """The parts as shares of their sum; empty if there is no time to divide."""
        whole = sum(self.parts.values())
        return {name: value / whole for name, value in self.parts.items()} if whole else {}


def totals(steps: Iterable[StepTiming]) -> Totals:
    """Return the totals of some steps of one scene, mode and repetition."""
    chosen = list(steps)
    counted = [s for s in chosen if not s.evaluation_only]
    executed = [s.seconds for s in counted if s.seconds is not None]
    peaks = [s.peak_mb for s in counted if s.peak_mb is not None]
    return Totals(
        work=sum(s.total_s for s in counted),
        elapsed=_elapsed(counted),
        parts={name: sum(getattr(s, name) for s in executed) for name in PARTS if executed},
        render=sum(s.total_s for s in chosen if s.evaluation_only),
        peak_mb=max(peaks, default=None),
    )


def scene_seconds(timing: SceneTiming) -> float | None:
    """Return the scene's latency: elapsed for executions, the clock for ``cached``.

    None if a step is missing, or no clock was read.
    """
    if not timing.complete:
        return None
    return timing.wall_s if timing.mode == "cached" else totals(timing.steps).elapsed


def without_rendering(clock_s: float | None, timing: SceneTiming) -> float | None:
    """Return a clock's seconds less the time in which nothing but rendering went on."""
    if clock_s is None:
        return None
    rendering = _elapsed(timing.steps)
    rest = _elapsed([s for s in timing.steps if not s.evaluation_only])
    return clock_s - ((rendering or 0.0) - (rest or 0.0))


def busy_spans(spans: Iterable[Span]) -> list[Span]:
    """Return the union of spans, as spans apart from each other, in order."""
    merged: list[Span] = []
    for start, end in sorted(spans):
        if merged and start <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(merged[-1][1], end)
        else:
            merged.append((start, end))
    return merged


def _elapsed(steps: Iterable[StepTiming]) -> float | None:
    spans = [s.span for s in steps]
    known = [span for span in spans if span is not None]
    if not known or len(known) < len(spans):
        return None
    return sum(end - start for start, end in busy_spans(known))
