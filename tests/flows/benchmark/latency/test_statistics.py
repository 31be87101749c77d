"""Totals, percentiles and shares, against numbers computed in another way."""

from __future__ import annotations

import io
import statistics
from itertools import pairwise

import numpy as np
import pyarrow.compute
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flows.benchmark.latency import paper
from flows.benchmark.latency.document import Measured, latency_document
from flows.benchmark.latency.machine import Machine
from flows.benchmark.latency.parquet import latency_parquet, latency_rows
from flows.benchmark.latency.percentiles import percentiles
from flows.benchmark.latency.timing import Mode, SceneTiming, StepTiming
from flows.benchmark.latency.totals import busy_spans, scene_seconds, totals, without_rendering
from tasks.step import Seconds

HERE = Machine("here", "a CPU", 2, 8.0)
SECONDS = st.floats(0, 1e4)
WHOLE = st.integers(0, 60)


def step(
    name: str, target: str, start: float, parts: Seconds, scene: str = "desk", repeat: int = 1,
    mode: Mode = "cold", peak_mb: float = 10.0,
) -> StepTiming:  # fmt: skip
    """Return a step that began to wait at ``start``."""
    began = start + parts.wait
    ended = start + parts.total
    return StepTiming(scene, target, name, mode, repeat, parts, None, began, ended, peak_mb)


def random_scene(rng: np.random.Generator, scene: str, repeat: int) -> SceneTiming:
    steps, now = [], 1000.0
    for name, target in (("register", ""), ("segment", "mug"), ("segment", "jar"), ("render", "")):
        parts = Seconds(*rng.uniform(0.1, 9.0, 4))
        steps.append(step(name, target, now, parts, scene, repeat, peak_mb=rng.uniform(1, 99)))
        now += 0.0 if target == "mug" else parts.total  # the objects' steps overlap
    return SceneTiming(scene, "cold", repeat, ("mug", "jar"), tuple(steps))


@pytest.fixture
def measured() -> Measured:
    rng = np.random.default_rng(7)
    scenes = [random_scene(rng, name, r) for name in ("desk", "hall", "attic") for r in (1, 2, 3)]
    return Measured(tuple(scenes), "made up", HERE)


@given(st.lists(SECONDS, min_size=2, max_size=40))
def test_percentiles_are_those_of_the_standard_library(values: list[float]) -> None:
    found = percentiles(values)
    cuts = statistics.quantiles(values, n=20, method="inclusive")
    assert found is not None and found.count == len(values)
    assert found.p50 == pytest.approx(statistics.median(values), abs=1e-9)
    assert found.p95 == pytest.approx(cuts[18], abs=1e-6)


def test_what_is_unknown_is_no_zero() -> None:
    assert percentiles([None, None]) is None
    found = percentiles([None, 3.0])
    assert found is not None and (found.p50, found.p95, found.count) == (3.0, 3.0, 1)


@given(st.lists(st.tuples(WHOLE, WHOLE), max_size=12))
def test_elapsed_is_the_time_in_which_at_least_one_step_went_on(
    pairs: list[tuple[int, int]],
) -> None:
    """Counted here second by second."""
    spans = [(start, start + length) for start, length in pairs]
    steps = [step("segment", f"t{i}", s, Seconds(compute=e - s)) for i, (s, e) in enumerate(spans)]
    ticked = sum(any(s <= t < e for s, e in spans) for t in range(121))
    found = totals(steps)
    assert found.elapsed == (ticked if spans else None)
    assert found.work == sum(e - s for s, e in spans)
    for before, after in pairwise(busy_spans((float(s), float(e)) for s, e in spans)):
        assert before[1] < after[0]


def test_rendering_is_taken_from_a_clock_only_where_nothing_else_went_on() -> None:
    steps = (
        step("simulate", "", 0.0, Seconds(compute=10.0)),
        step("render", "", 6.0, Seconds(compute=9.0)),
    )
    timing = SceneTiming("desk", "cold", 1, (), steps, wall_s=20.0)
    assert without_rendering(20.0, timing) == pytest.approx(15.0)
    assert scene_seconds(timing) == pytest.approx(10.0)


def test_a_scenes_percentiles_are_over_repetitions_and_all_scenes_over_medians(
    measured: Measured,
) -> None:
    document = latency_document(measured)
    medians = []
    for scene in document["scenes"]:
        own = [t for t in measured.timings if t.scene == scene["scene"]]
        # register, then the objects side by side; nothing waits for the renders
        elapsed = [t.steps[0].total_s + max(t.steps[1].total_s, t.steps[2].total_s) for t in own]
        cold = scene["modes"]["cold"]
        assert cold["p50_s"] == pytest.approx(np.percentile(elapsed, 50))
        assert cold["p95_s"] == pytest.approx(np.percentile(elapsed, 95))
        assert cold["per_object_s"] == pytest.approx(np.median(elapsed) / 2)
        assert cold["peak_mb"] == max(s.peak_mb or 0 for t in own for s in t.steps[:3])
        assert sum(cold["shares"].values()) == pytest.approx(1.0)
        medians.append(np.median(elapsed))
    over = document["over_scenes"]["cold"]
    assert over["count"] == 3
    assert over["p95_s"] == pytest.approx(np.percentile(medians, 95))
    assert document["over_scenes"]["warm"] == {"p50_s": None, "p95_s": None, "count": 0}


def test_a_step_counts_once_a_scene_and_object(measured: Measured) -> None:
    document = latency_document(measured)
    segment = next(s for s in document["steps"] if s["step"] == "segment")
    medians = [
        np.median([t.steps[i].total_s for t in measured.timings if t.scene == name])
        for name in ("desk", "hall", "attic")
        for i in (1, 2)
    ]
    assert segment["calls"] == segment["modes"]["cold"]["count"] == 6
    assert segment["modes"]["cold"]["p50_s"] == pytest.approx(np.percentile(medians, 50))
    assert segment["modes"]["cold"]["p95_s"] == pytest.approx(np.percentile(medians, 95))
    parts = np.array(
        [
            [s.seconds.load, s.seconds.compute, s.seconds.publish, s.seconds.wait]
            for t in measured.timings
            for s in t.steps[1:3]
            if s.seconds
        ]
    )
    shares = list(segment["modes"]["cold"]["shares"].values())
    np.testing.assert_allclose(shares, parts.sum(0) / parts.sum())


def test_an_object_has_the_sum_of_its_own_steps(measured: Measured) -> None:
    desk = latency_document(measured)["scenes"][0]
    jar = next(o for o in desk["by_object"] if o["object"] == "jar")
    own = [t.steps[2].total_s for t in measured.timings if t.scene == "desk"]
    assert jar["modes"]["cold"]["p95_s"] == pytest.approx(np.percentile(own, 95))


def test_parquet_gives_back_every_row(measured: Measured) -> None:
    table = pyarrow.parquet.read_table(io.BytesIO(latency_parquet(measured.timings)))
    rows = list(latency_rows(measured.timings))
    assert table.num_rows == len(rows) == 9 * (1 + 2 + 4)
    for read, row in zip(table.to_pylist(), rows, strict=True):
        assert {name: value for name, value in read.items() if value is not None} == {
            name: value for name, value in row.items() if value is not None
        }
    scenes = table.filter(pyarrow.compute.field("level") == "scene")
    np.testing.assert_allclose(
        scenes["seconds"].to_numpy(), [scene_seconds(t) for t in measured.timings]
    )


def test_parquet_has_no_totals_of_a_scene_with_a_missing_step(measured: Measured) -> None:
    first = measured.timings[0]
    broken = SceneTiming("desk", "cold", 1, first.objects, first.steps, ("compose",))
    assert {row["level"] for row in latency_rows([broken])} == {"step"}


def test_the_papers_means_are_those_of_its_scenes() -> None:
    assert len(paper.SCENES) == 5
    assert np.mean([s.litereality_s for s in paper.SCENES]) == pytest.approx(4332.8)
    assert np.mean([s.garden_s for s in paper.SCENES]) == pytest.approx(560.2)
    assert paper.MEAN.ratio == pytest.approx(7.7, abs=0.05)
