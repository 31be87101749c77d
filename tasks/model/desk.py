"""Serve questions to models on this machine's devices, one model a device at a time.

Each place (the CPU, and every GPU) is a thread with at most one worker. It changes the model
only when nobody asks the loaded one, or somebody else was overtaken too often (``turn``).
A GPU's slot of the budget is held while a model is on it.
"""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from garden_models.scene import BadInput
from tasks.model.launch import Launch
from tasks.model.tally import Tally
from tasks.model.turn import MOST_OVERTAKEN, next_turn, overtake
from tasks.model.worker import ModelWorker
from tasks.step.budget import Budget, Need

LINGER_S = 2.0
"""How long a place keeps a model for those who have it in use and ask nothing just now."""

IDLE_S = 120.0
"""How long a model stays without being asked."""

_GPU = Need(cores=0, memory_gb=0.0, gpus=1)


@dataclass(eq=False)
class Question:
    """One question, and what comes of it."""

    launch: Launch
    folder: Path
    digest: str
    tell: Callable[[float, str], None]
    gone: threading.Event
    overtaken: int = 0
    outcome: dict[str, Any] | Exception | None = None
    done: threading.Event = field(default_factory=threading.Event)

    def end(self, outcome: dict[str, Any] | Exception) -> None:
        """Let go of whoever waits for the answer."""
        self.outcome = outcome
        self.done.set()


class Desk:
    """All places of this machine."""

    def __init__(self, budget: Budget, idle_s: float = IDLE_S, linger_s: float = LINGER_S) -> None:
        self.tally = Tally()
        self.idle_s = idle_s
        self.linger_s = linger_s
        self._budget = budget
        self._changed = threading.Condition()
        self._queues: dict[str, list[Question]] = {}
        self._users: dict[Launch, int] = {}
        self._places: list[Place] = []

    def put(self, question: Question) -> None:
        """Queue a question; its ``done`` is set when there is an answer or an error."""
        with self._changed:
            device = question.launch.device
            if device not in self._queues:
                self._queues[device] = []
                self._open(device)
            self._queues[device].append(question)
            self._changed.notify_all()

    def use(self, launch: Launch, change: int) -> None:
        """Note that somebody has a model in use (+1), or not any more (-1)."""
        with self._changed:
            self._users[launch] = self._users.get(launch, 0) + change
            self._changed.notify_all()

    def close(self) -> None:
        """End all workers."""
        for place in self._places:
            place.close()

    def take(self, device: str, loaded: Launch | None, since: float) -> Question | None:
        """Return the next question for a place, None if its model should go.

        ``since`` is when the place answered last.
        """
        with self._changed:
            while True:
                queue = self._queues[device]
                queue[:] = [q for q in queue if not q.gone.is_set()]
                turn = next_turn(queue, loaded)
                now = time.monotonic()
                if turn is not None and not self._lingers(queue, turn, loaded, now - since):
                    overtake(queue, turn)
                    return queue.pop(turn)
                if turn is None and loaded is not None and now - since > self.idle_s:
                    return None
                self._changed.wait(0.05 if turn is not None else 1.0)

    def _lingers(
        self, queue: list[Question], turn: int, loaded: Launch | None, idle_s: float
    ) -> bool:
        """Tell whether the loaded model is kept a moment for those who have it in use."""
        if loaded is None or queue[turn].launch == loaded:
            return False
        if queue[turn].overtaken >= MOST_OVERTAKEN or idle_s > self.linger_s:
            return False
        return self._users.get(loaded, 0) > 0

    def _open(self, device: str) -> None:
        for gpus in _gpus_of(device, self._budget.gpus):
            budget = dataclasses.replace(self._budget, gpus=gpus)
            place = Place(self, device, budget)
            self._places.append(place)
            threading.Thread(target=place.work, daemon=True).start()


def _gpus_of(device: str, gpus: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return, for each place of a device, the GPUs that it may take."""
    kind, _, number = device.partition(":")
    if kind != "cuda":
        return [()]
    if number:
        return [gpus[int(number) : int(number) + 1]]
    return [gpus for _ in gpus] or [()]


class Place:
    """One device with at most one worker."""

    def __init__(self, desk: Desk, device: str, budget: Budget) -> None:
        self._desk = desk
        self._device = device
        self._budget = budget
        self._worker: ModelWorker | None = None
        self._slot = ExitStack()
        self._stopped = threading.Event()

    def work(self) -> None:
        """Serve until the process ends."""
        since = time.monotonic()
        while not self._stopped.is_set():
            loaded = self._worker.launch if self._worker and self._worker.alive else None
            question = self._desk.take(self._device, loaded, since)
            if question is None:
                self._unload()
            else:
                self._serve(question)
            since = time.monotonic()

    def close(self) -> None:
        """End the worker, from any thread."""
        self._stopped.set()
        if self._worker is not None:
            self._worker.close()

    def _serve(self, question: Question) -> None:
        tally, name = self._desk.tally, question.launch.name
        try:
            worker = self._worker_for(question)
            fresh = not worker.loaded
            try:
                said = worker.ask(
                    question.folder, question.digest, question.tell, question.gone.is_set
                )
            finally:
                if fresh and worker.loaded:
                    tally.loaded(name, worker.loaded)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is this question's alone
            tally.failed(name)
            question.end(error)
        else:
            tally.answered(name, said)
            question.end(said)

    def _worker_for(self, question: Question) -> ModelWorker:
        worker = self._worker
        if worker is not None and worker.alive and worker.launch == question.launch:
            return worker
        self._unload()
        gpu = None
        if self._device.startswith("cuda"):
            if not self._budget.gpus:
                raise BadInput(f"{question.launch.name} runs on a GPU, and this run may use none")
            held = self._slot.enter_context(self._budget.hold(_GPU, question.gone))
            gpu = ",".join(held.gpus)
        self._worker = ModelWorker(question.launch, gpu)
        return self._worker

    def _unload(self) -> None:
        if self._worker is not None:
            self._worker.close()
            self._worker = None
        self._slot.close()
