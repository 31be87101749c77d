"""Measure what orchestration adds to a cold scene: the time in which no step works.

A scene is run from an empty store as a Prefect flow. From every step's finish, its
seconds of publishing and of computing, follows when its function ran. Steps of several
targets overlap, so the share is of wall-clock time: whatever of it no step's function
covers is look-ups, Prefect, waiting, loading and publishing that nothing hid.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from flows.benchmark.orchestration.server import prefect_server
from storage import Store
from tasks.step import StepEvent

Interval = tuple[float, float]


@dataclass(frozen=True)
class SceneOverhead:
    """Seconds of one cold scene.

    ``wall_s`` is that of the whole flow run, from its call to its end. ``computing_s`` is
    how much of it at least one step's function ran, ``working_s`` the same with loading
    its inputs. The other four are sums over all steps, which overlap. ``server_start_s``
    comes once a process, or not at all where a server runs already.
    """

    scene: str
    steps: int
    wall_s: float
    computing_s: float
    working_s: float
    compute_s: float
    load_s: float
    publish_s: float
    wait_s: float
    server_start_s: float

    @property
    def overhead(self) -> float:
        """Percent of the wall-clock time in which no step computed or loaded its inputs."""
        return 100 * (1 - self.working_s / self.wall_s)

    @property
    def strict_overhead(self) -> float:
        """Percent of the wall-clock time in which no step computed."""
        return 100 * (1 - self.computing_s / self.wall_s)


class SceneFailed(RuntimeError):
    """The scene to be timed did not come out."""


def measure_scene(capture: Path, folder: Path) -> SceneOverhead:
    """Factorize ``capture`` from an empty store below ``folder``, with a server of its own.

    Raises SceneFailed.
    """
    from flows.benchmark.captures import scene_of
    from flows.scene_run import run_scene

    events: list[StepEvent] = []
    request = scene_of(capture, package=folder / "package")
    starting = time.monotonic()
    with prefect_server(folder / "prefect"):
        started = time.monotonic()
        result = run_scene(request, Store.open(folder / "store"), events.append)
        wall = time.monotonic() - started
    if result.refs.failure is not None:
        raise SceneFailed(f"{capture}: {result.refs.failure}")
    done = [event for event in events if event.kind == "finished"]
    if unexpected := [event for event in done if event.outcome != "executed"]:
        raise SceneFailed(f"{capture}: {unexpected[0].step} was {unexpected[0].outcome}, not run")
    return overhead_of(request.name, done, wall, started - starting)


def overhead_of(
    scene: str, done: list[StepEvent], wall_s: float, server_start_s: float
) -> SceneOverhead:
    """Return the overhead of a run from the events of its finished steps."""
    computing, working = [], []
    for event in done:
        end = event.time - event.seconds.publish
        begin = end - event.seconds.compute
        computing.append((begin, end))
        working.append((begin - event.seconds.load, end))
    return SceneOverhead(
        scene,
        len(done),
        wall_s,
        covered(computing),
        covered(working),
        sum(event.seconds.compute for event in done),
        sum(event.seconds.load for event in done),
        sum(event.seconds.publish for event in done),
        sum(event.seconds.wait for event in done),
        server_start_s,
    )


def covered(intervals: Iterable[Interval]) -> float:
    """Return the length of the union of intervals."""
    total, reached = 0.0, float("-inf")
    for begin, end in sorted(intervals):
        if end > reached:
            total += end - max(begin, reached)
            reached = end
    return total
