"""Say in words how a collection stands: for the batch itself and for other terminals."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

from flows.collection.row import ENDED, RunningStep, SceneRow, Status
from flows.collection.state import CollectionState
from tasks.step import step_name

MARKS = {"ok": "✓", "degraded": "!", "failed": "✗", "stopped": "■", "running": "▸", "waiting": "·"}
_COUNTED: tuple[Status, ...] = ("ok", "degraded", "failed", "stopped", "running", "waiting")


def counts(state: CollectionState) -> dict[str, int]:
    """Return how many scenes have each status."""
    found = Counter(row.status for row in state.rows.values())
    return {status: found[status] for status in _COUNTED if found[status]}


def seconds_left(state: CollectionState, now: float | None = None) -> float | None:
    """Estimate how long a running batch takes still, from the scenes that it has finished.

    None if it does not run, or none that had something to do has finished.
    """
    if state.phase != "running":
        return None
    now = time.time() if now is None else now
    done = [
        row.seconds
        for row in state.rows.values()
        if row.executed and row.status in ENDED and (row.finished or 0.0) >= state.started
    ]
    if not done:
        return None
    mean = sum(done) / len(done)
    left = 0.0
    for row in state.rows.values():
        if row.status == "running":
            left += max(mean - (now - (row.started or now)), 0.0)
        elif row.status == "waiting":
            left += mean
    return left / max(state.scenes_at_once, 1)


def summary(state: CollectionState) -> str:
    """Return one line on the whole collection."""
    known = counts(state)
    ended = sum(known.get(status, 0) for status in ENDED)
    text = f"{state.name}: {state.phase}, {ended} of {len(state.rows)} scenes done"
    if known:
        text += " (" + ", ".join(f"{count} {status}" for status, count in known.items()) + ")"
    left = seconds_left(state)
    return text + (f", about {duration(left)} left" if left is not None else "")


def scene_line(row: SceneRow) -> str:
    """Return one line on a scene that has ended."""
    facts = []
    if row.photos:
        facts.append(f"{row.photos[1]} of {row.photos[0]} photos")
    if row.objects and row.objects[0]:
        facts.append(f"{row.objects[1]} of {row.objects[0]} objects")
    if row.executed:
        facts.append(f"{row.executed} steps in {duration(row.seconds)}")
    elif row.cached and row.status in ENDED:
        facts.append("nothing to do")
    text = f"{MARKS[row.status]} {row.name:<24} {row.status:<9} {', '.join(facts)}"
    if row.status != "ok" and row.reasons:
        more = f" (and {len(row.reasons) - 1} more)" if len(row.reasons) > 1 else ""
        text += f"  {row.reasons[0]}{more}"
    return text.rstrip()


def running_line(row: SceneRow, now: float | None = None) -> str:
    """Return one line on a scene that runs: for how long, and its steps."""
    now = time.time() if now is None else now
    steps = "; ".join(_step(step) for step in row.running) or "waits for cores or memory"
    elapsed = duration(now - (row.started or now))
    return f"{MARKS['running']} {row.name:<24} {elapsed:>9}  {steps}"


def _step(step: RunningStep) -> str:
    text = step_name(step.step, step.target)
    if step.share:
        text += f" {100 * step.share:.0f} %"
    return text + (f" ({step.doing})" if step.doing else "")


def model_lines(state: CollectionState) -> list[str]:
    """Return one line on each model that the batch asked: how often it was loaded, and asked."""
    return [f"{name}: {model_facts(cost)}" for name, cost in state.models.items()]


def model_facts(cost: dict[str, Any]) -> str:
    """Return what a model cost, in words."""
    loads = f"loaded {_times(cost['loads'])} in {duration(cost['load_s'])}"
    asked = f"asked {_times(cost['calls'])} in {duration(cost['run_s'])}"
    failed = f", {_times(cost['failures'])} without an answer" if cost["failures"] else ""
    gpu = f", {cost['peak_gpu_gb']:.1f} GB of a GPU" if cost["peak_gpu_gb"] else ""
    return f"{loads}, {asked}{failed}; peak {cost['peak_gb']:.1f} GB{gpu}"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def duration(seconds: float) -> str:
    """Return a span of time with the two units that matter."""
    whole = max(round(seconds), 0)
    if whole < 60:
        return f"{seconds:.1f} s" if seconds < 10 else f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
