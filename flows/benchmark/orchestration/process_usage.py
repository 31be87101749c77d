"""Read what processes use, from Linux's /proc: one, a group, or all that one started."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_TICK_S = 1 / os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Usage:
    """CPU seconds used so far, and resident bytes now, of all processes together."""

    cpu_s: float
    rss: int
    processes: int


def group_usage(group: int) -> Usage:
    """Return what the live processes of the group use (and the dead ones they waited for)."""
    return _total([fields for fields in _processes().values() if int(fields[2]) == group])


def process_usage(pid: int) -> Usage:
    """Return what one process uses."""
    return _total([fields for fields in (_fields(pid),) if fields is not None])


def children_usage(pid: int, without_group: int | None = None) -> Usage:
    """Return what the live processes use that a process started, and those that they did."""
    processes = _processes()
    below = {pid}
    while more := {p for p, f in processes.items() if int(f[1]) in below and p not in below}:
        below |= more
    return _total([processes[p] for p in below - {pid} if int(processes[p][2]) != without_group])


def _total(processes: list[list[str]]) -> Usage:
    ticks = sum(sum(int(fields[index]) for index in range(11, 15)) for fields in processes)
    pages = sum(int(fields[21]) for fields in processes)
    return Usage(ticks * _TICK_S, pages * _PAGE, len(processes))


def _processes() -> dict[int, list[str]]:
    pids = [int(entry.name) for entry in os.scandir("/proc") if entry.name.isdigit()]
    return {pid: fields for pid in pids if (fields := _fields(pid)) is not None}


def _fields(pid: int) -> list[str] | None:
    """Return the fields of /proc/PID/stat from the state on (proc(5), field 3 is index 0)."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return status[status.rindex(")") + 2 :].split()
