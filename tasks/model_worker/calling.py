"""Call a model: seeded, without gradients, at the precision asked for, with typed errors."""

from __future__ import annotations

import contextlib
import gc
import random
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np

from garden_models.foundation.failure import ModelOutOfMemory

Dtype = Literal["float32", "bfloat16"]
Predict = Callable[[Any], Any]


def call(predict: Predict, request: Any, name: str, device: str, dtype: Dtype) -> Any:
    """Return a model's answer; the same for the same request, whatever ran before.

    The generators start at the request's ``seed`` (0 if it has none) and are put back.

    Raises:
        ModelOutOfMemory: it needs more memory than the device has.
    """
    seed = int(getattr(request, "seed", 0))
    with _seeded(seed), torch_mode(device, dtype), out_of_memory_as(name, device):
        return predict(request)


@contextmanager
def out_of_memory_as(name: str, device: str) -> Iterator[None]:
    """Raise ModelOutOfMemory for what Python, numpy and torch raise in its place."""
    try:
        yield
    except ModelOutOfMemory:
        raise
    except Exception as error:
        if not _is_out_of_memory(error):
            raise
        said = str(error).partition("\n")[0] or type(error).__name__
        raise ModelOutOfMemory(f"{name} does not fit into the memory of {device}: {said}") from None


def free_memory() -> None:
    """Give back the memory of models that nothing holds any more, also a GPU's."""
    gc.collect()
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available() and torch.cuda.is_initialized():
        torch.cuda.empty_cache()


def peak_gpu_gb() -> float:
    """Return the most GPU memory that torch held since the last call; 0 without a GPU."""
    torch = sys.modules.get("torch")
    if torch is None or not torch.cuda.is_available() or not torch.cuda.is_initialized():
        return 0.0
    peak = max(torch.cuda.max_memory_allocated(i) for i in range(torch.cuda.device_count()))
    for index in range(torch.cuda.device_count()):
        torch.cuda.reset_peak_memory_stats(index)
    return float(peak) / 1e9


def _is_out_of_memory(error: Exception) -> bool:
    return isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError"


@contextmanager
def _seeded(seed: int) -> Iterator[None]:
    python, ours = random.getstate(), np.random.get_state()
    random.seed(seed)
    np.random.seed(seed % 2**32)
    try:
        with _seeded_torch(seed):
            yield
    finally:
        random.setstate(python)
        np.random.set_state(ours)


@contextmanager
def _seeded_torch(seed: int) -> Iterator[None]:
    torch = sys.modules.get("torch")
    if torch is None:
        yield
        return
    with torch.random.fork_rng(devices=_started_gpus(torch)):
        torch.manual_seed(seed)
        yield


def _started_gpus(torch: Any) -> list[int]:
    if not (torch.cuda.is_available() and torch.cuda.is_initialized()):
        return []
    return list(range(torch.cuda.device_count()))


@contextmanager
def torch_mode(device: str, dtype: Dtype) -> Iterator[None]:
    """Keep no gradients, and run at the precision asked for."""
    torch = sys.modules.get("torch")
    if torch is None:
        yield
        return
    with contextlib.ExitStack() as stack:
        stack.enter_context(torch.inference_mode())
        if dtype == "bfloat16":
            kind = device.partition(":")[0]
            stack.enter_context(torch.autocast(kind, dtype=torch.bfloat16))
        yield
