"""A few simulated scenes through the real collection runner: counts and structure, no times."""

from __future__ import annotations

from itertools import accumulate
from pathlib import Path

import pytest

from flows.benchmark.orchestration import scale
from flows.benchmark.orchestration.growth import Growth, growth_of
from flows.benchmark.orchestration.process_usage import Usage
from flows.benchmark.orchestration.sampling import Sample
from flows.benchmark.orchestration.scale import (
    FinishedScene,
    Restart,
    ScaleOptions,
    ScaleResult,
    measure_scale,
)
from flows.benchmark.orchestration.scale_report import blocks_of, scale_sections
from flows.benchmark.orchestration.simulated_scene import steps_of
from flows.collection.job import JobOrder
from storage import Store

SMALL = ScaleOptions(scenes=5, objects=2, engine="local")
MB = 1_000_000


@pytest.mark.slow
def test_every_scene_runs_once_and_a_restart_executes_nothing(tmp_path: Path) -> None:
    result = measure_scale(SMALL, tmp_path)
    assert len(result.finished) == SMALL.scenes
    assert (result.restart.executed, result.restart.cached) == (0, SMALL.steps)
    store = Store.open(tmp_path / "store", create=False)
    records = list(store.actions())
    assert len(records) == SMALL.steps == 5 * steps_of(2)
    assert {record.scene for record in records} == {f"scene_{n:06}" for n in range(5)}
    assert result.store["actions"].files == SMALL.steps
    assert result.store["latest"].files == SMALL.steps
    assert len(list(store.objects())) == SMALL.steps
    assert result.samples[-1].parent.rss > 0


@pytest.mark.slow
def test_a_server_counts_what_it_was_told(tmp_path: Path) -> None:
    options = ScaleOptions(scenes=2, objects=1, engine="prefect")
    result = measure_scale(options, tmp_path)
    assert result.restart.executed == 0
    assert result.server is not None
    assert result.server.rows["task_run"] == options.steps
    assert result.server.rows["flow_run"] == options.scenes + 1
    assert result.server.rows["events"] == 0  # lean
    assert result.server.cpu_s > 0
    titles = [section.title for section in scale_sections(result)]
    assert len(titles) == 4


def test_a_scene_that_failed_is_told_and_the_figures_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scale, "simulated_orders", orders_that_fail)
    result = measure_scale(SMALL, tmp_path)
    assert "scene_000001 is failed" in result.wrong[0]
    assert "4 of 5 scenes did not come out" in result.wrong[1]


def orders_that_fail(scenes: int, objects: int) -> list[JobOrder]:
    job = "flows.benchmark.orchestration.simulated_job:SimulatedJob"
    return [JobOrder(f"scene_{n:06}", job, {"number": n}) for n in (1,)]


def measured(
    cpu_s: list[float],
    ours_mb: list[int],
    restart_s: float = 1.0,
    scene_s: list[float] | None = None,
) -> ScaleResult:
    """Return a run in which scene ``i`` ended at second ``i + 1``, with one sample a second."""
    spent = [0.0, *accumulate(cpu_s)]
    samples = [
        Sample(i + 0.5, Usage(1.0, 50 * MB, 1), Usage(spent[i], (mb - 50) * MB, 2), Usage(0, 0, 0))
        for i, mb in enumerate(ours_mb)
    ]
    finished = [FinishedScene(i + 1.0, s) for i, s in enumerate(scene_s or [2.0] * len(cpu_s))]
    options = ScaleOptions(len(cpu_s), 5, "local")
    restart = Restart(restart_s, 0, options.steps)
    store = {"objects": Growth(10, 5, 1000, 4096), "actions": Growth(2, 1, 100, 4096)}
    return ScaleResult(options, 0.0, float(len(cpu_s)), finished, samples, store, restart, 600)


def test_the_last_block_is_held_against_the_first() -> None:
    result = measured([1.0] * 300 + [1.1] * 100, [100] * 400)
    blocks = blocks_of(result)
    assert [block.first for block in blocks] == [0, 100, 200, 300]
    assert [block.wall_s for block in blocks] == [100.0] * 4
    claims = scale_sections(result)[0].claims
    assert all(claim.holds for claim in claims)
    slower = scale_sections(measured([1.0] * 300 + [1.3] * 100, [100] * 400))[0].claims
    assert [claim.holds for claim in slower] == [True, False, True, True, True, True]
    later = measured([1.0] * 400, [100] * 400, scene_s=[1.0] * 300 + [1.3] * 100)
    assert [c.holds for c in scale_sections(later)[0].claims] == [False] + [True] * 5
    larger = scale_sections(measured([1.0] * 400, [100] * 300 + [130] * 100))[0].claims
    assert [claim.holds for claim in larger] == [True, True, False, True, True, True]
    late = scale_sections(measured([1.0] * 400, [100] * 400, restart_s=61.0))[0].claims
    assert [claim.holds for claim in late] == [True, True, True, False, True, True]


def test_few_scenes_make_four_blocks() -> None:
    assert [len(block.scenes) for block in blocks_of(measured([1.0] * 9, [100] * 9))] == [2] * 4


def test_the_stores_growth_is_summed() -> None:
    rows = scale_sections(measured([1.0] * 4, [100] * 4))[1].rows
    assert [row["part"] for row in rows] == ["objects", "actions", "all"]
    assert (rows[-1]["files"], rows[-1]["folders"]) == (12, 6)


def test_a_hundred_thousand_scenes_take_as_much_each() -> None:
    section = scale_sections(measured([1.0] * 4, [100] * 4, restart_s=2.0))[-1]
    rows = {row["what"]: row["100000 scenes"] for row in section.rows}
    assert rows["wall-clock time here"] == "27.8 h"
    assert rows["restart over finished scenes"] == "833 min"
    assert rows["inodes of the store"] == "0.45 million"
    assert rows["collection.json"] == "15 MB"
    assert "database of the Prefect server" not in rows


def test_growth_counts_files_folders_and_bytes(tmp_path: Path) -> None:
    assert growth_of(tmp_path / "none") == Growth()
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "one").write_bytes(b"12345")
    (tmp_path / "a" / "b" / "two").write_bytes(b"6789")
    grown = growth_of(tmp_path)
    assert (grown.files, grown.folders, grown.bytes) == (2, 2, 9)
    assert grown.disk_bytes > 0
