"""Find the sample capture beside this file, for tests from any working folder."""

from __future__ import annotations

from pathlib import Path

from flows.benchmark.corner_truth import CornerTruth, TruthObject, TruthView
from flows.benchmark.corner_truth import load_corner as _load

CORNER = Path(__file__).resolve().parent / "corner"


def load_corner() -> CornerTruth:
    """Read the sample capture with all of its truth; photos are read on demand."""
    return _load(CORNER)


__all__ = ["CORNER", "CornerTruth", "TruthObject", "TruthView", "load_corner"]
