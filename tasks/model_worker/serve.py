"""Load one model and answer what is asked of it, until standard input ends."""

from __future__ import annotations

import json
import os
import platform
import queue
import resource
import sys
import threading
import time
import traceback
from importlib import import_module
from pathlib import Path
from typing import Any

from garden_models.foundation.failure import ModelOutOfMemory
from tasks.model_worker import protocol
from tasks.model_worker.calling import (
    Predict,
    call,
    free_memory,
    out_of_memory_as,
    peak_gpu_gb,
)
from tasks.model_worker.nouns import nouns_of
from tasks.model_worker.payload import read_payload, write_payload
from tasks.parent_process import Answers, die_with


def main() -> None:
    """Speak the protocol on standard input and output; what libraries print goes to the log.

    The first word is the process to die with; 0 if it cannot be seen from here (a container).
    """
    parent = int(sys.argv[1])
    if parent:
        die_with(parent)
    answers = Answers(os.dup(1))
    os.dup2(2, 1)
    requests: queue.Queue[dict[str, Any]] = queue.Queue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    answers.send({protocol.HELLO: _about()})
    served = _Served(answers)
    while True:
        served.obey(requests.get())


def _about() -> dict[str, Any]:
    return {"protocol": protocol.VERSION, "pid": os.getpid(), "python": platform.python_version()}


def _listen(requests: queue.Queue[dict[str, Any]]) -> None:
    """Pass on what is asked; end this process, whatever it does, when nobody asks any more."""
    for line in sys.stdin.buffer:
        requests.put(json.loads(line))
    os._exit(0)


class _Served:
    """The model that is loaded, and what it is asked."""

    def __init__(self, answers: Answers) -> None:
        self._answers = answers
        self._load: dict[str, Any] = {}
        self._predict: Predict | None = None

    def obey(self, message: dict[str, Any]) -> None:
        """Do what one message says, and answer it."""
        try:
            if protocol.LOAD in message:
                self._answers.send({protocol.LOADED: self._do_load(message[protocol.LOAD])})
            else:
                self._answers.send({protocol.ANSWER: self._do_ask(message[protocol.ASK])})
        except Exception as error:  # noqa: BLE001 - it is told, and the next question may fit
            self._answers.send({protocol.ERROR: _described(error)})
            if isinstance(error, ModelOutOfMemory):
                free_memory()

    def _do_load(self, load: dict[str, Any]) -> dict[str, Any]:
        self._answers.progress(0.0, f"loading {load['name']}")
        started = time.monotonic()
        adapter = import_module(load["module"])
        with out_of_memory_as(load["name"], load["device"]):
            self._predict = adapter.load(Path(load["weights"]), load["device"])
        self._load = load
        return {"seconds": time.monotonic() - started, **peaks()}

    def _do_ask(self, ask: dict[str, Any]) -> dict[str, Any]:
        if self._predict is None:
            raise RuntimeError("asked before a model was loaded")
        self._answers.progress(0.0, f"running {self._load['name']}")
        started = time.monotonic()
        expected, _answer = nouns_of(self._load["module"])
        folder = Path(ask["folder"])
        request = read_payload(folder / protocol.REQUEST_FOLDER, ask["digest"], expected)
        name, device, dtype = (self._load[key] for key in ("name", "device", "dtype"))
        answer = call(self._predict, request, name, device, dtype)
        digest = write_payload(answer, folder / protocol.ANSWER_FOLDER)
        seconds = time.monotonic() - started
        return {"id": ask["id"], "digest": digest, "seconds": seconds, **peaks()}


def peaks() -> dict[str, float]:
    """Return the most memory of this process so far, and of a GPU since the last call, in GB."""
    resident = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    kilobyte = 1 if sys.platform == "darwin" else 1024
    return {"peak_gb": resident * kilobyte / 1e9, "peak_gpu_gb": peak_gpu_gb()}


def _described(error: Exception) -> dict[str, Any]:
    return {
        "kind": type(error).__name__,
        "message": str(error),
        "traceback": "".join(traceback.format_exception(error)),
    }
