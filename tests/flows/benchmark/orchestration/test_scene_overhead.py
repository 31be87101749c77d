"""What counts as overhead of a scene: the time that no step's work covers."""

from __future__ import annotations

import pytest

from flows.benchmark.orchestration.cost import scene_section
from flows.benchmark.orchestration.scene_overhead import covered, overhead_of
from tasks.step import Seconds, StepEvent


def finished(at: float, *, load: float, compute: float, publish: float) -> StepEvent:
    seconds = Seconds(load, compute, publish)
    return StepEvent("finished", "a", "", "room", at, outcome="executed", seconds=seconds)


def test_overlapping_work_counts_once() -> None:
    assert covered([]) == 0
    assert covered([(0, 2), (1, 3), (5, 6)]) == 4
    assert covered([(5, 6), (0, 10), (2, 3)]) == 10


def test_the_rest_of_the_wall_clock_time_is_overhead() -> None:
    # Two steps in a row, each 1 s of loading, 8 s of work, 1 s of publishing, then a pause.
    done = [
        finished(10.0, load=1, compute=8, publish=1),
        finished(20.0, load=1, compute=8, publish=1),
    ]
    measured = overhead_of("room", done, wall_s=25.0, server_start_s=6.0)
    assert measured.overhead == pytest.approx(100 * 7 / 25)
    assert measured.strict_overhead == pytest.approx(100 * 9 / 25)
    assert (measured.load_s, measured.compute_s, measured.publish_s) == (2, 16, 2)
    section = scene_section(measured)
    assert section.rows[0]["steps"] == 2
    assert not section.claims[0].holds


def test_publishing_behind_another_steps_work_is_no_overhead() -> None:
    done = [
        finished(10.0, load=0, compute=9, publish=1),
        finished(20.0, load=0, compute=11, publish=0),
    ]
    measured = overhead_of("room", done, wall_s=20.0, server_start_s=0.0)
    assert measured.strict_overhead == pytest.approx(0.0)
