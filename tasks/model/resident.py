"""Keep models loaded in this process: one a device, until another one is asked for."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from tasks.model.launch import Launch
from tasks.model_worker.calling import Predict, call, free_memory, out_of_memory_as


@dataclass
class _Place:
    """What is loaded on a device; ``guard`` lets one call use it at a time."""

    guard: threading.RLock
    launch: Launch | None = None
    predict: Predict | None = None


class Residents:
    """The models of this process by device; ``loads`` counts how often one was loaded."""

    def __init__(self) -> None:
        self._places: dict[str, _Place] = {}
        self._guard = threading.Lock()
        self.loads = 0

    def call(self, launch: Launch, request: Any) -> Any:
        """Return a model's answer; it is loaded first if it is not what the device holds.

        Raises ModelOutOfMemory, and what the adapter raises.
        """
        place = self._place(launch.device)
        with place.guard:
            if place.launch != launch or place.predict is None:
                self._load(place, launch)
            assert place.predict is not None
            return call(place.predict, request, launch.name, launch.device, launch.dtype)

    def free(self) -> None:
        """Let go of all models."""
        for place in list(self._places.values()):
            with place.guard:
                _clear(place)

    def _place(self, device: str) -> _Place:
        with self._guard:
            return self._places.setdefault(device, _Place(threading.RLock()))

    def _load(self, place: _Place, launch: Launch) -> None:
        _clear(place)
        load = import_module(launch.module).load
        with out_of_memory_as(launch.name, launch.device):
            place.predict = load(launch.weights, launch.device)
        place.launch = launch
        self.loads += 1


def _clear(place: _Place) -> None:
    if place.predict is not None:
        place.launch = place.predict = None
        free_memory()


residents = Residents()
