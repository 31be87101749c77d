"""The deployed latency report says where it is, and fails rather than report nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from flows.deployed.latency import latency_report
from storage import Store
from tests.flows.benchmark.latency.filled_store import Clock, fill, request


def reported(home: Path) -> Any:
    """Run the flow's function over the captures, without a server."""
    return latency_report.fn(str(home / "captures"), str(home / "scenes"), str(home / "store"))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", durability="none")


def test_a_collection_that_the_store_knows_is_reported(tmp_path: Path, store: Store) -> None:
    for name in ("desk", "shelf"):
        fill(store, request(tmp_path, name, ()), Clock())
    state = reported(tmp_path)
    assert state.name == "Completed"
    assert Path(state.data["report"]).read_text().count("desk") > 0
    assert Path(state.data["report"]) == (tmp_path / "scenes" / "latency" / "latency.html")


def test_a_scene_without_seconds_makes_it_degraded(tmp_path: Path, store: Store) -> None:
    fill(store, request(tmp_path, "desk", ()), Clock())
    request(tmp_path, "shelf")
    state = reported(tmp_path)
    assert state.name == "Degraded"
    assert "shelf" in state.message


def test_a_store_that_knows_no_scene_is_a_failure(tmp_path: Path, store: Store) -> None:
    request(tmp_path, "desk")
    state = reported(tmp_path)
    assert state.name == "Failed"
    assert "desk" in state.message


def test_no_store_and_no_collection_say_so(tmp_path: Path) -> None:
    assert "no such" in reported(tmp_path).message
    request(tmp_path, "desk")
    assert "there is no store at" in reported(tmp_path).message
