from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from storage import Store
from storage.leases import Lease, LeaseTable
from tests.s3_server import BUCKET


@pytest.fixture
def store(tmp_path: Path, request: pytest.FixtureRequest) -> Store:
    """A new store: in a folder, or on whatever ``on_any_medium`` asks for."""
    if getattr(request, "param", "folder") == "folder":
        return Store.open(tmp_path / "store", durability="none")
    request.getfixturevalue("s3")
    return Store.open(f"s3://{BUCKET}/{uuid.uuid4().hex}/store")


@pytest.fixture(autouse=True)
def no_leases_left(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Renew no lease of an earlier test while a later one counts the store's calls."""
    tables: list[LeaseTable] = []
    acquire = LeaseTable.try_acquire

    def noted(table: LeaseTable, key: str) -> Lease | None:
        tables.append(table)
        return acquire(table, key)

    monkeypatch.setattr(LeaseTable, "try_acquire", noted)
    yield
    for table in tables:
        table.abandon_all()
