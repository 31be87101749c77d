"""Summarise seconds by their median and 95th percentile."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Percentiles:
    """Median and 95th percentile of ``count`` values, linear between neighbours."""

    p50: float
    p95: float
    count: int


def percentiles(values: Iterable[float | None]) -> Percentiles | None:
    """Return the percentiles of the values that are known; None if none is."""
    known = [value for value in values if value is not None]
    if not known:
        return None
    p50, p95 = np.percentile(known, [50, 95])
    return Percentiles(float(p50), float(p95), len(known))


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the values that are known; None if none is."""
    found = percentiles(values)
    return None if found is None else found.p50
