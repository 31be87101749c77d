"""Count what each model cost: how often it was loaded and asked, and the seconds and memory."""

from __future__ import annotations

import dataclasses
import threading
from dataclasses import dataclass
from typing import Any


@dataclass
class Cost:
    """One model's; ``peak_gb`` is resident memory, ``peak_gpu_gb`` what torch held of a GPU."""

    loads: int = 0
    calls: int = 0
    failures: int = 0
    load_s: float = 0.0
    run_s: float = 0.0
    peak_gb: float = 0.0
    peak_gpu_gb: float = 0.0


class Tally:
    """The costs of all models by name; from any thread."""

    def __init__(self) -> None:
        self._costs: dict[str, Cost] = {}
        self._guard = threading.Lock()

    def loaded(self, name: str, said: dict[str, Any]) -> None:
        """Count a load, by what the worker says of it (``protocol.COSTS``)."""
        with self._guard:
            cost = self._costs.setdefault(name, Cost())
            cost.loads += 1
            cost.load_s += said["seconds"]
            _see(cost, said)

    def answered(self, name: str, said: dict[str, Any]) -> None:
        """Count an answer, by what the worker says of it."""
        with self._guard:
            cost = self._costs.setdefault(name, Cost())
            cost.calls += 1
            cost.run_s += said["seconds"]
            _see(cost, said)

    def failed(self, name: str) -> None:
        """Count a question without an answer."""
        with self._guard:
            self._costs.setdefault(name, Cost()).failures += 1

    def to_json(self) -> dict[str, dict[str, Any]]:
        """Return plain JSON by model."""
        with self._guard:
            return {name: dataclasses.asdict(cost) for name, cost in self._costs.items()}


def _see(cost: Cost, said: dict[str, Any]) -> None:
    cost.peak_gb = max(cost.peak_gb, said["peak_gb"])
    cost.peak_gpu_gb = max(cost.peak_gpu_gb, said["peak_gpu_gb"])


def added(one: dict[str, dict[str, Any]], other: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return two tallies (as JSON) together; of peaks the higher one counts."""
    total = {name: dict(cost) for name, cost in one.items()}
    for name, cost in other.items():
        known = total.setdefault(name, dataclasses.asdict(Cost()))
        for what, value in cost.items():
            both = known[what], value
            known[what] = max(both) if what.startswith("peak") else sum(both)
    return total
