"""Read what the processes of one group use, from Linux's /proc."""

from __future__ import annotations

import os
from collections.abc import Iterator
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
    return _total([fields for fields in _processes() if int(fields[2]) == group])


def process_usage(pid: int) -> Usage:
    """Return what one process uses."""
    return _total([fields for fields in (_fields(pid),) if fields is not None])


def _total(processes: list[list[str]]) -> Usage:
    ticks = sum(sum(int(fields[index]) for index in range(11, 15)) for fields in processes)
    pages = sum(int(fields[21]) for fields in processes)
    return Usage(ticks * _TICK_S, pages * _PAGE, len(processes))


def _processes() -> Iterator[list[str]]:
    for entry in os.scandir("/proc"):
        if entry.name.isdigit() and (fields := _fields(int(entry.name))) is not None:
            yield fields


def _fields(pid: int) -> list[str] | None:
    """Return the fields of /proc/PID/stat from the state on (proc(5), field 3 is index 0)."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return status[status.rindex(")") + 2 :].split()
