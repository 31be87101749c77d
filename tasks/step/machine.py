"""Tell how much this process may use: cores, memory and GPUs of the machine or its cgroup."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

_CGROUPS = Path("/sys/fs/cgroup")
_UNLIMITED = 1 << 60  # what cgroup v1 writes for "no limit" is larger


def usable_cores() -> tuple[int, ...]:
    """Return the numbers of the cores that this process may use, at least one.

    Of those that it may run on, as many as its cgroup gives time for.
    """
    if hasattr(os, "sched_getaffinity"):
        cores = sorted(os.sched_getaffinity(0))
    else:
        cores = list(range(os.cpu_count() or 1))
    return tuple(cores[: max(1, math.ceil(_cpu_quota()))])


def usable_memory_gb() -> float:
    """Return the memory that this process and its children may use together, in GB."""
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limits = [machine]
    for folder in _folders("memory"):
        for name in ("memory.max", "memory.limit_in_bytes"):
            limits += [int(word) for word in _words(folder / name) if word.isdigit()]
    return min(limit for limit in limits if limit < _UNLIMITED) / 1e9


def usable_gpus() -> tuple[str, ...]:
    """Return the names (CUDA's numbers) of the GPUs that this process may use."""
    chosen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if chosen is not None:
        return tuple(name.strip() for name in chosen.split(",") if name.strip() not in ("", "-1"))
    devices = Path("/dev").glob("nvidia[0-9]*")
    numbers = sorted(int(digits) for d in devices if (digits := d.name[6:]).isdigit())
    return tuple(str(i) for i in range(len(numbers)))


def _cpu_quota() -> float:
    """Return the cores' worth of time that the cgroups allow."""
    allowed = [math.inf]
    for folder in _folders("cpu"):
        words = _words(folder / "cpu.max")
        if not words:
            words = _words(folder / "cpu.cfs_quota_us") + _words(folder / "cpu.cfs_period_us")
        if len(words) == 2 and words[0].isdigit() and int(words[1]) > 0:
            allowed.append(int(words[0]) / int(words[1]))
    finite = min(allowed)
    return finite if math.isfinite(finite) else float(os.cpu_count() or 1)


def _folders(controller: str) -> Iterator[Path]:
    """Give the folders of this process' cgroup and of those around it, version 2 and 1."""
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _number, controllers, inside = line.split(":", 2)
        if controllers and controller not in controllers.split(","):
            continue
        root = _CGROUPS / controller if controllers else _CGROUPS
        place = root / inside.strip("/")
        yield from (place, *(parent for parent in place.parents if parent.is_relative_to(root)))


def _words(path: Path) -> list[str]:
    try:
        return path.read_text().split()
    except OSError:
        return []
