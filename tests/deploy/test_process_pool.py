"""The process pool end to end: a real server, real worker, deployments as a user gets them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.deploy.conftest import ROOT, Service, wait_for

pytestmark = pytest.mark.slow


def runs_of(service: Service, deployment: str, state: str) -> list[Any]:
    """Return the flow runs of a deployment that ended in ``state``."""
    from prefect.client.schemas.filters import DeploymentFilter, DeploymentFilterName

    with service.client() as client:
        runs = client.read_flow_runs(
            deployment_filter=DeploymentFilter(name=DeploymentFilterName(any_=[deployment]))
        )
    return [run for run in runs if run.state and run.state.type.value == state]


def states_of_tasks(service: Service, runs: list[Any]) -> Counter[tuple[str, str]]:
    """Count the task runs of some flow runs by step and state."""
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId

    ids = FlowRunFilter(id=FlowRunFilterId(any_=[run.id for run in runs]))
    with service.client() as client:
        found = wait_for(  # the server takes task runs in with some delay
            "all task runs",
            lambda: (
                len(tasks := client.read_task_runs(flow_run_filter=ids)) == 2 * len(runs)
                and all(task.state and task.state.is_final() for task in tasks)
                and tasks
            ),
            120,
        )
    return Counter((task.name, task.state.name) for task in found)


def deploy_toy(service: Service, folder: Path, interval_s: int, asked: Path) -> None:
    """Deploy the toy collection into the same pool, with the same pull step."""
    document = yaml.safe_load((ROOT / "deploy" / "prefect.yaml").read_text())
    toy = {
        "name": "toy",
        "entrypoint": "tests/deploy/toy_flow.py:toy_collection",
        "parameters": {"asked": str(asked)},
        "schedules": [{"interval": interval_s, "slug": "soon"}],
        "concurrency_limit": {"limit": 1, "collision_strategy": "CANCEL_NEW"},
        "work_pool": document["definitions"]["any_worker"],
    }
    path = folder / "prefect.yaml"
    path.write_text(yaml.safe_dump(document | {"deployments": [toy]}))
    service.prefect(
        "--no-prompt", "deploy", "--prefect-file", str(path), "--all", GARDEN_HOME=str(ROOT)
    )


def test_a_worker_runs_a_deployment_and_a_failure_says_why(pool: Service, tmp_path: Path) -> None:
    capture = tmp_path / "no photos"
    capture.mkdir()
    pool.prefect(
        "deployment", "run", "factorize-capture/factorize", "--param", f"capture={capture}"
    )
    [run] = wait_for("the flow run", lambda: runs_of(pool, "factorize", "FAILED"), 180)
    assert "no photos in" in run.state.message


def test_a_schedule_fires_by_itself_and_executes_only_what_changed(
    pool: Service, tmp_path: Path
) -> None:
    asked = tmp_path / "asked.json"
    asked.write_text(json.dumps({"count": 4, "factor": 2.0}))
    deploy_toy(pool, tmp_path, 8, asked)
    try:
        before = wait_for("two runs", lambda: at_least(2, completed_toys(pool)), 240)
        assert all(run.auto_scheduled for run in before)
        states = states_of_tasks(pool, before)
        assert states["make", "Completed"] == states["scale", "Completed"] == 1
        assert states["make", "Cached"] == states["scale", "Cached"] == len(before) - 1

        asked.write_text(json.dumps({"count": 4, "factor": 3.0}))
        known = {run.id for run in before}
        after = wait_for("two more", lambda: at_least(2, completed_toys(pool, known)), 240)
        states = states_of_tasks(pool, after)
        assert states["make", "Completed"] == 0
        assert states["scale", "Completed"] == 1
    finally:
        with pool.client() as client:
            client.delete_deployment(client.read_deployment_by_name("toy-collection/toy").id)


def completed_toys(service: Service, known: Collection[Any] = ()) -> list[Any]:
    return [run for run in runs_of(service, "toy", "COMPLETED") if run.id not in known]


def at_least(count: int, runs: list[Any]) -> list[Any]:
    return runs if len(runs) >= count else []


def test_the_nightly_collection_says_what_failed_and_executes_only_what_changed(
    pool: Service, tmp_path: Path
) -> None:
    from prefect.client.schemas.schedules import IntervalSchedule

    for number, scene in enumerate(("desk", "shelf")):
        blank_photos(tmp_path / "rooms" / scene, shade=100 + number)
    collection = ("--collection", str(tmp_path / "rooms"))
    pool.python("deploy/register.py", *collection, "--out", str(tmp_path / "out"))
    with pool.client() as client:
        deployment = client.read_deployment_by_name("factorize-collection/collection")
        often = IntervalSchedule(interval=timedelta(seconds=15))
        client.create_deployment_schedules(deployment.id, [(often, True)])
    try:
        nights = wait_for(
            "two nights", lambda: at_least(2, runs_of(pool, "collection", "FAILED")), 400
        )
        assert scenes_ingested(pool) == {"desk": 1, "shelf": 1}
        blank_photos(tmp_path / "rooms" / "shelf", shade=200)
        wait_for("another night", lambda: scenes_ingested(pool)["shelf"] == 2, 400)
    finally:
        with pool.client() as client:
            client.delete_deployment(deployment.id)
    assert scenes_ingested(pool)["desk"] == 1
    for night in nights:
        assert night.auto_scheduled
        assert night.state.message.startswith("2 of 2 scenes failed; desk: no two of the 3 photos")


def blank_photos(folder: Path, shade: int) -> None:
    """Write photos that can be read, and in which nothing can be matched."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for number in range(3):
        Image.new("RGB", (64, 48), (shade, shade, number)).save(folder / f"{number}.png")


def scenes_ingested(service: Service) -> Counter[str]:
    """Count the task runs that ingested a capture (and not its cached artifact), by scene."""
    from prefect.client.schemas.filters import TaskRunFilter, TaskRunFilterName

    ingest = TaskRunFilter(name=TaskRunFilterName(any_=["ingest"]))
    with service.client() as client:
        scenes = {run.id: run.name for run in client.read_flow_runs()}
        tasks = client.read_task_runs(task_run_filter=ingest)
    return Counter(
        scenes[task.flow_run_id] for task in tasks if task.state and task.state.name == "Completed"
    )
