"""Steps as Prefect task runs: what the server sees, and that the run reaches its threads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from garden_models.scene import Target
from storage import Store
from tasks.step import Ref, RunContext, StepEvent, StepFailed, fan_out, run_context
from tests.tasks.step.toy import Scaling, make, pick, ran, scale

pytestmark = pytest.mark.slow

TARGETS = [Target(name, "a.jpg", (0.0, 0.0, 1.0, 1.0)) for name in ("one", "two", "bad")]


def run_flow(store: Store, body: Any) -> tuple[Any, list[tuple[str, str, str]], list[StepEvent]]:
    """Run ``body`` as a flow; give its result, the task runs (name, type, state), the events."""
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId
    from prefect.context import get_run_context
    from prefect.task_runners import ThreadPoolTaskRunner

    ids = []

    def watched() -> Any:
        ids.append(get_run_context().flow_run.id)
        return body()

    events: list[StepEvent] = []
    with run_context(RunContext(store, "room", "prefect", events=events.append)):
        result = flow(watched, name="toy", task_runner=ThreadPoolTaskRunner(max_workers=2))()
    runs: list[Any] = []
    with get_client(sync_client=True) as client:
        for _attempt in range(50):  # the server takes task runs in with some delay
            runs = client.read_task_runs(
                flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=ids))
            )
            done = [e for e in events if e.kind == "finished"]
            if len(runs) >= len(done) and all(r.state and r.state.is_final() for r in runs):
                break
            __import__("time").sleep(0.2)
    return result, sorted((r.name, r.state.type.value, r.state.name) for r in runs), events


def test_task_runs_are_named_cached_and_failed_as_the_store_says(
    prefect_server: str, tmp_path: Path
) -> None:
    store = Store.open(tmp_path / "store", durability="none")

    def body() -> list[Ref | StepFailed]:
        numbers = scale(make(4), Scaling())
        return fan_out(lambda target: pick(target, numbers), TARGETS)

    ran.clear()
    first, runs, _events = run_flow(store, body)
    assert runs == [
        ("make", "COMPLETED", "Completed"),
        ("pick[bad]", "FAILED", "Failed"),
        ("pick[one]", "COMPLETED", "Completed"),
        ("pick[two]", "COMPLETED", "Completed"),
        ("scale", "COMPLETED", "Completed"),
    ]
    assert isinstance(first[2], StepFailed)
    assert first[2].kind == "BadInput"
    assert sorted(ran) == ["make", "pick bad", "pick one", "pick two", "scale"]

    ran.clear()
    second, runs, events = run_flow(store, body)
    assert ran == ["pick bad"]
    assert {name: state for name, _type, state in runs} == {
        "make": "Cached",
        "pick[bad]": "Failed",
        "pick[one]": "Cached",
        "pick[two]": "Cached",
        "scale": "Cached",
    }
    assert [ref.content for ref in second[:2]] == [ref.content for ref in first[:2]]
    assert [e.outcome for e in events if e.step == "scale"] == ["cached"]


def test_submitted_steps_start_when_their_inputs_are_there(
    prefect_server: str, tmp_path: Path
) -> None:
    store = Store.open(tmp_path / "store", durability="none")

    def body() -> list[Any]:
        numbers = scale.submit(make.submit(4), Scaling(3.0))
        futures = [pick.submit(target, numbers) for target in TARGETS]
        return [future.exception() or future.result() for future in futures]

    result, runs, _events = run_flow(store, body)
    assert [ref.label for ref in result[:2]] == ["one", "two"]
    assert isinstance(result[2], StepFailed)
    assert result[2].name == "pick[bad]"
    assert len(runs) == 5
