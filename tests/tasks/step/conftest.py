from __future__ import annotations

from pathlib import Path

import pytest

from storage import Store
from tests.tasks.step import toy


@pytest.fixture
def store(tmp_path: Path) -> Store:
    toy.ran.clear()
    return Store.open(tmp_path / "store", durability="none")
