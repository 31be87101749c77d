"""How many requests to a bucket a small step makes: the figures that docs/scale.md plans with."""

from __future__ import annotations

from collections import Counter
from typing import Any, Literal

import pytest

from flows.benchmark.orchestration.simulated_scene import simulated_scene, steps_of
from storage import Store
from tasks.step import RunContext, run_context
from tests.s3_server import BUCKET, S3Server

ADDRESS = f"s3://{BUCKET}/requests"
OBJECTS = 1


def requests_a_step(s3: S3Server, engine: Literal["local", "plan"]) -> dict[str, int]:
    """Run a scene with a fresh client; return its requests a step, by what they are billed as."""
    store = Store.open(ADDRESS)
    s3.counted()
    with run_context(RunContext(store, "room", engine)):
        simulated_scene(0, OBJECTS)
    counts = Counter(kind_of(request) for request in s3.counted())
    a_step = {kind: round(count / steps_of(OBJECTS)) for kind, count in counts.items()}
    return {kind: count for kind, count in a_step.items() if count}  # a run's own pin rounds away


def kind_of(request: dict[str, Any]) -> str:
    """A request to the bucket itself is a listing (GET) or removes several names (POST)."""
    if request["path"].partition("?")[0].strip("/") == BUCKET:
        return {"GET": "LIST", "POST": "DELETE"}[request["method"]]
    return str(request["method"])


@pytest.mark.slow
def test_requests_a_step(s3: S3Server) -> None:
    Store.open(ADDRESS)
    miss = requests_a_step(s3, "local")
    assert (miss["PUT"], miss["DELETE"]) == (7, 1)  # 3 members, manifest, lease, action, latest
    assert miss["LIST"] == 6
    assert miss["GET"] in (17, 18)
    assert requests_a_step(s3, "local") == {"GET": 3, "LIST": 1}
    assert requests_a_step(s3, "plan") == {"GET": 2, "LIST": 1}
