"""Measure one model with so many photos: bare, and through a step and the keeper."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from flows.benchmark.models.asking_step import Questions, ask_model
from flows.benchmark.models.questions import questions
from garden_models import foundation
from garden_models.foundation.failure import ModelFailed
from storage import Store
from storage.redact import redact
from tasks.model.keeper_process import model_keeper
from tasks.model.launch import Launch, launch_of
from tasks.model.weights import backend_of
from tasks.model.worker_start import worker_command, worker_environment
from tasks.model_worker.payload import write_payload
from tasks.step import Ref, RunContext, run_context

_TAIL = 400


@dataclass(frozen=True)
class Cost:
    """Seconds to load, and to answer about all photos once (median of the repeats after the
    first, which warms up); the most memory, in GB.
    """

    load_s: float
    run_s: float
    peak_gb: float
    peak_gpu_gb: float


@dataclass(frozen=True)
class Measured:
    """One model with so many photos. ``step`` is the whole step; ``model`` the worker's part."""

    model: str
    device: str
    dtype: str
    photos: int
    bare: Cost
    step: Cost
    model_s: float

    def row(self) -> dict[str, Any]:
        """Return a line of the table."""
        gpu = max(self.bare.peak_gpu_gb, self.step.peak_gpu_gb) > 0
        return {
            "model": self.model,
            "device": self.device,
            "dtype": self.dtype,
            "photos": self.photos,
            "load s, bare": self.bare.load_s,
            "load s": self.step.load_s,
            "run s, bare": self.bare.run_s,
            "run s, in the worker": self.model_s,
            "run s, whole step": self.step.run_s,
            "step / bare": self.step.run_s / self.bare.run_s,
            "peak GB, bare": self.bare.peak_gb,
            "peak GB": self.step.peak_gb,
            "GPU GB, bare": self.bare.peak_gpu_gb if gpu else None,
            "GPU GB": self.step.peak_gpu_gb if gpu else None,
        }


def measure(name: str, photos: int, size: tuple[int, int], repeats: int, folder: Path) -> Measured:
    """Measure both ways, each in processes of its own.

    Raises BadInput, ModelFailed, ModelOutOfMemory: the model does not run here.
    """
    launch = launch_of(name)
    asked = questions(foundation.card(name).stage, photos, size)
    bare = _bare(launch, asked, repeats, folder / "bare")
    step, model_s = _through_steps(name, asked, repeats, folder / "store")
    return Measured(backend_of(name), launch.device, launch.dtype, photos, bare, step, model_s)


def _bare(launch: Launch, asked: list[Any], repeats: int, folder: Path) -> Cost:
    folder.mkdir()
    digests = [write_payload(q, folder / str(number)) for number, q in enumerate(asked)]
    order = {
        "name": launch.name,
        "module": launch.module,
        "weights": str(launch.weights),
        "device": launch.device,
        "dtype": launch.dtype,
        "folder": str(folder),
        "digests": digests,
        "repeats": repeats,
    }
    file = folder / "order.json"
    file.write_text(json.dumps(order), "utf-8")
    command = worker_command(launch, "tasks.model_worker.bare_loop", str(file))
    done = subprocess.run(
        command, env=worker_environment(), capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise ModelFailed(f"{launch.name} does not run bare: {redact(done.stderr)[-_TAIL:]}")
    said = json.loads(done.stdout.splitlines()[-1])
    return Cost(said["load_s"], _typical(said["run_s"]), said["peak_gb"], said["peak_gpu_gb"])


def _through_steps(name: str, asked: list[Any], repeats: int, folder: Path) -> tuple[Cost, float]:
    store = Store.open(folder)
    seconds: list[float] = []
    model: list[float] = [0.0]
    with model_keeper() as costs, run_context(RunContext(store, "benchmark")):
        given = store.publish(Questions(tuple(asked)))
        ref = Ref(given.kind, given.content, given.object, "", "given")
        for repeat in range(repeats):
            done = ask_model(ref, name, repeat)
            model.append(costs()[name]["run_s"])
            load = costs()[name]["load_s"] if repeat == 0 else 0.0
            seconds.append(done.seconds.total - load)
        last = costs()[name]
    spent = [after - before for before, after in pairwise(model)]
    cost = Cost(last["load_s"], _typical(seconds), last["peak_gb"], last["peak_gpu_gb"])
    return cost, _typical(spent)


def _typical(seconds: list[float]) -> float:
    return median(seconds[1:] or seconds)
