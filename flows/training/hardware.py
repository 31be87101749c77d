"""Say what a training ran on and how long it took."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tasks.step import Ref


def hardware() -> dict[str, Any]:
    """Return processor, cores, GPU and the versions that compute."""
    import torch

    gpu = torch.cuda.get_device_name(0) if torch.cuda.is_available() else ""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "gpu": gpu,
        "python": platform.python_version(),
        "torch": version("torch"),
    }


def hours(data: Iterable[Ref], training: Iterable[Ref]) -> dict[str, float]:
    """Return the hours of computing, also where results came from the store."""
    parts = {
        name: sum(ref.seconds.compute for ref in refs) / 3600
        for name, refs in (("data", data), ("training", training))
    }
    parts["total"] = parts["data"] + parts["training"]
    return {name: round(value, 3) for name, value in parts.items()}


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
