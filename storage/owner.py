"""Say which process owns something, so that what it leaves can be told from what it uses."""

from __future__ import annotations

import functools
import os
import socket
from dataclasses import dataclass
from pathlib import Path

from storage.digest import digest_bytes


@dataclass(frozen=True)
class Owner:
    """A process.

    ``boot_id`` and ``pid_space`` (the process-id namespace: containers of one machine do
    not see each other's processes) say where ``pid`` means something; ``started`` (clock
    ticks after boot) tells a reused pid apart.
    """

    host: str
    boot_id: str
    pid_space: str
    pid: int
    started: int

    @classmethod
    def here(cls) -> Owner:
        """Return this process."""
        boot_id, pid_space = _place()
        pid = os.getpid()
        return cls(socket.gethostname(), boot_id, pid_space, pid, _start_ticks(pid))

    def is_dead(self) -> bool:
        """Tell whether the process is surely gone; False where that cannot be known.

        A process of an earlier boot of this host is gone; of another host nothing is known.
        """
        boot_id, pid_space = _place()
        if self.boot_id != boot_id:
            return self.host == socket.gethostname()
        if self.pid_space != pid_space:
            return False
        return _start_ticks(self.pid) != self.started


def own_mark() -> str:
    """Return a short mark of this process, for names of files that may hold nothing yet."""
    pid = os.getpid()
    return "-".join([*_place_marks(), str(pid), str(_start_ticks(pid))])


def is_dead_mark(mark: str) -> bool:
    """Tell whether ``mark`` is one of ``own_mark`` whose process is surely gone."""
    try:
        host, boot, space, pid, started = mark.split("-")
        process = int(pid), int(started)
    except ValueError:
        return False
    own_host, own_boot, own_space = _place_marks()
    if boot != own_boot:
        return host == own_host
    return space == own_space and _start_ticks(process[0]) != process[1]


@functools.cache
def _place_marks() -> tuple[str, str, str]:
    boot_id, pid_space = _place()
    names = socket.gethostname(), boot_id, pid_space
    host, boot, space = (digest_bytes(name.encode())[3:11] for name in names)
    return host, boot, space


@functools.cache
def _place() -> tuple[str, str]:
    try:
        boot_id = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        pid_space = str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        return socket.gethostname(), ""
    return boot_id, pid_space


def _start_ticks(pid: int) -> int:
    """Return when a live process started (0 if unknown), -1 if there is none."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return -1 if Path("/proc/self/stat").exists() else _probe(pid)
    fields = status[status.rindex(")") + 2 :].split()
    return -1 if fields[0] == "Z" else int(fields[19])


def _probe(pid: int) -> int:
    """Return 0 for a live process and -1 for none, on systems without /proc."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return -1
    except PermissionError:
        return 0
    return 0
