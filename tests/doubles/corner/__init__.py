"""Adapters that answer the sample capture's truth; registered in place of the published ones.

Each has ``CARD`` and ``load(weights, device)`` as an adapter has. Its weight folder holds one
file, ``fault.txt``: which convention is broken on purpose (empty: none). What lies between the
adapter and the published code runs as it is.

    install(monkeypatch, tmp_path, sam3d_objects="quaternion_order")
"""

from __future__ import annotations

from pathlib import Path

import pytest

from garden_models import foundation

MODELS = ("sam3", "sam2", "sam3d_objects", "foundation_pose")


def install(monkeypatch: pytest.MonkeyPatch, folder: Path, **faults: str) -> None:
    """Register the doubles, their weights below ``folder``; ``faults`` by model."""
    for name in MODELS:
        monkeypatch.setitem(foundation.ADAPTERS, name, f"tests.doubles.corner.{name}")
        put_fault(folder, name, faults.get(name, ""))
    monkeypatch.setenv("GARDEN_WEIGHTS", str(folder))


def put_fault(folder: Path, name: str, fault: str) -> None:
    """Write a model's weights: the fault that it has."""
    (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / name / "fault.txt").write_text(fault)


def read_fault(weights: Path) -> str:
    return (weights / "fault.txt").read_text().strip()
