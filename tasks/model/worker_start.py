"""Start a model's worker with the Python that the machine's settings name."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path

from garden_models.foundation.failure import ModelFailed
from storage.redact import without_secret_variables
from tasks.model.exchange import exchange_root
from tasks.model.launch import Launch
from tasks.model_worker import start
from tasks.step.child_process import ChildProcess

_OURS = ("garden_models", "tasks", "storage")
_OFFLINE = {"HF_HUB_OFFLINE": "1", "TRANSFORMERS_OFFLINE": "1", "PYTHONUNBUFFERED": "1"}
_NOT_THEIRS = ("PYTHONPATH", "PYTHONHOME", "PYTHONSAFEPATH", "VIRTUAL_ENV")

_starter = ThreadPoolExecutor(1, "garden-model-starter")
"""A worker dies with the thread that started it: this one lives as long as the process."""


def start_worker(launch: Launch, gpu: str | None) -> ChildProcess:
    """Return a new worker, which sees ``gpu`` only, if one is given.

    It gets none of this process' secrets, and its libraries are told to stay off the network.

    Raises ModelFailed if it cannot be started.
    """
    return _starter.submit(_start, launch, gpu).result()


def _start(launch: Launch, gpu: str | None) -> ChildProcess:
    command = worker_command(launch)
    descriptor, log = tempfile.mkstemp(prefix="garden-model-", suffix=".log")
    with os.fdopen(descriptor, "wb") as printed:
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=printed,
                start_new_session=True,
                env=worker_environment(gpu),
            )
        except OSError as error:
            Path(log).unlink()
            raise ModelFailed(
                f"{launch.name}: {command[0]} could not be started ({error.strerror}):"
                f" correct {launch.name}.python in the model settings"
            ) from None
    assert process.stdout is not None
    answers = os.dup(process.stdout.fileno())
    process.stdout.close()
    return ChildProcess(process, answers, Path(log))


def interpreter(python: tuple[str, ...] | None, weights: Path) -> list[str]:
    """Return the words that start the settings' Python: our own if they name none.

    ``{exchange}``, ``{weights}`` and ``{code}`` in them are the folders that it must see.
    """
    values = {
        "exchange": str(exchange_root()),
        "weights": str(weights),
        "code": _folder_of("tasks"),
    }
    return [word.format_map(values) for word in python or (sys.executable,)]


def worker_command(launch: Launch, *more: str) -> list[str]:
    """Return the words that start a worker; ``more`` are those of ``start``'s that follow."""
    folders = {name: _folder_of(name) for name in (*_OURS, launch.module.partition(".")[0])}
    words = interpreter(launch.python, launch.weights)
    parent = os.getpid() if len(words) == 1 else 0  # a wrapper, a container: not the parent
    return [*words, str(Path(start.__file__)), str(parent), json.dumps(folders), *more]


def _folder_of(package: str) -> str:
    """Return the folder in which a package lies."""
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError(f"{package} is no package", name=package)
    return str(Path(next(iter(spec.submodule_search_locations))).parent)


def worker_environment(gpu: str | None = None) -> dict[str, str]:
    """Return what a worker's process is told, ``gpu`` being the only one that it sees if given."""
    environment = without_secret_variables(os.environ) | _OFFLINE
    for name in _NOT_THEIRS:
        environment.pop(name, None)
    if gpu is not None:
        environment["CUDA_VISIBLE_DEVICES"] = gpu
    return environment
