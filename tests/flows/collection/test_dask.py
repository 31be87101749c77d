"""A collection whose steps are computed by Dask workers that share only a bucket."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.collection.run import Options, run_jobs
from flows.step_runner import Runner
from storage import Store
from tasks.step import Budget
from tests.flows.collection.toy_job import STEPS, collection, toys
from tests.s3_server import BUCKET, S3Server
from tests.tasks.step.dask_cluster import dask_cluster


@pytest.mark.slow
def test_the_steps_of_all_scenes_are_spread_over_the_workers(s3: S3Server, tmp_path: Path) -> None:
    address = f"s3://{BUCKET}/collection"
    Store.open(address)
    (tmp_path / "slots").mkdir()
    budget = Budget((0, 1), 4.0, (), tmp_path / "slots")
    with dask_cluster(tmp_path, workers=2) as cluster:
        options = Options("local", 2, budget=budget, runner=Runner(f"dask:{cluster.address}"))
        orders = toys(tmp_path, a="", b="", c="", d="fails")
        first = run_jobs(collection(tmp_path), orders, address, options)
        pids = {worker.pid for worker in cluster.workers}
        again = run_jobs(collection(tmp_path), orders, address, options)
    assert {row.name: row.status for row in first.rows} == {
        "a": "ok",
        "b": "ok",
        "c": "ok",
        "d": "failed",
    }
    lines = [line.split() for line in (tmp_path / "ran.log").read_text().splitlines()]
    ran = [(number, int(pid)) for what, number, pid in lines if what == "link"]
    assert len(ran) == len(set(ran)) == 3 * STEPS
    assert {pid for _number, pid in ran} == pids
    assert {row.name: row.executed for row in again.rows} == dict.fromkeys("abcd", 0)
