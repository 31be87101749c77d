"""Keep models loaded for this process: one a device, until another one is asked for."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

from tasks.model.ask_worker import ask_worker
from tasks.model.launch import Launch
from tasks.model.worker import ModelWorker, Report
from tasks.model_worker.calling import Predict, call, free_memory, out_of_memory_as


class Loaded(Protocol):
    """A model that can be asked, wherever it is; not ``alive`` any more after some errors."""

    launch: Launch

    @property
    def alive(self) -> bool:
        """Whether it can be asked again."""

    def ask(self, request: Any, report: Report, stopped: Callable[[], bool]) -> Any:
        """Return its answer."""

    def close(self) -> None:
        """Let go of it, and of its memory."""


class LoadedHere:
    """A model in this process."""

    def __init__(self, launch: Launch) -> None:
        self.launch = launch
        self.alive = True
        load = import_module(launch.module).load
        with out_of_memory_as(launch.name, launch.device):
            self._predict: Predict | None = load(launch.weights, launch.device)

    def ask(self, request: Any, report: Report, stopped: Callable[[], bool]) -> Any:
        """Return its answer."""
        assert self._predict is not None
        launch = self.launch
        try:
            return call(self._predict, request, launch.name, launch.device, launch.dtype)
        except MemoryError:
            free_memory()
            raise

    def close(self) -> None:
        """Let go of it, and of its memory."""
        self._predict, self.alive = None, False
        free_memory()


class LoadedElsewhere:
    """A model in a worker process of this one."""

    def __init__(self, launch: Launch) -> None:
        self.launch = launch
        self._worker = ModelWorker(launch)

    @property
    def alive(self) -> bool:
        """Whether it can be asked again."""
        return self._worker.alive

    def ask(self, request: Any, report: Report, stopped: Callable[[], bool]) -> Any:
        """Return its answer."""
        return ask_worker(
            lambda folder, digest: self._worker.ask(folder, digest, report, stopped),
            self.launch,
            request,
        )

    def close(self) -> None:
        """End the worker."""
        self._worker.close()


@dataclass
class _Place:
    """What is loaded on a device; ``guard`` lets one call use it at a time."""

    guard: threading.RLock
    loaded: Loaded | None = None


class Residents:
    """The models of this process by device; ``loads`` counts how often one was loaded."""

    def __init__(self) -> None:
        self._places: dict[str, _Place] = {}
        self._guard = threading.Lock()
        self.loads = 0

    def ask(self, launch: Launch, request: Any, report: Report, stopped: Callable[[], bool]) -> Any:
        """Return a model's answer; it is loaded first if it is not what the device holds.

        Raises what ``ModelWorker.ask`` does, and what the adapter raises.
        """
        place = self._place(launch.device)
        with place.guard:
            loaded = place.loaded
            if loaded is None or loaded.launch != launch or not loaded.alive:
                loaded = self._load(place, launch)
            return loaded.ask(request, report, stopped)

    def free(self) -> None:
        """Let go of all models."""
        for place in list(self._places.values()):
            with place.guard:
                _clear(place)

    def _place(self, device: str) -> _Place:
        with self._guard:
            return self._places.setdefault(device, _Place(threading.RLock()))

    def _load(self, place: _Place, launch: Launch) -> Loaded:
        _clear(place)
        here = launch.python is None and not launch.own_process
        made: Loaded = LoadedHere(launch) if here else LoadedElsewhere(launch)
        self.loads += 1
        place.loaded = made
        return made


def _clear(place: _Place) -> None:
    if place.loaded is not None:
        loaded, place.loaded = place.loaded, None
        loaded.close()


residents = Residents()
atexit.register(residents.free)
