from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from storage import Store
from storage.leases import Lease, LeaseTable


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", durability="none")


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
