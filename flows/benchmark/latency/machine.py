"""Name this machine's hardware, from what the kernel says."""

from __future__ import annotations

import os
import socket
import subprocess
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Machine:
    """One machine: host name, processor, cores that may be used, memory in GB, GPUs."""

    host: str
    cpu: str
    cores: int
    memory_gb: float
    gpus: tuple[str, ...] = ()

    def line(self) -> str:
        """Return it in words."""
        gpus = ", ".join(self.gpus) if self.gpus else "no GPU"
        return f"{self.cpu}, {self.cores} cores, {self.memory_gb:.0f} GB of memory, {gpus}"


def this_machine(proc: Path = Path("/proc")) -> Machine:
    """Return the machine that this process runs on."""
    return Machine(
        socket.gethostname(),
        _field(proc / "cpuinfo", ("model name", "Hardware", "cpu model")) or "unknown CPU",
        len(os.sched_getaffinity(0)),
        round(_kilobytes(_field(proc / "meminfo", ("MemTotal",))) * 1024 / 1e9, 1),
        _gpus(proc),
    )


def _field(path: Path, names: tuple[str, ...]) -> str:
    try:
        lines = path.read_text(errors="replace").splitlines()
    except OSError:
        return ""
    found = dict(line.partition(":")[::2] for line in reversed(lines))
    values = {name.strip(): value.strip() for name, value in found.items()}
    return next((values[name] for name in names if values.get(name)), "")


def _kilobytes(text: str) -> float:
    number = text.split(maxsplit=1)[0] if text else ""
    return float(number) if number.isdigit() else 0.0


def _gpus(proc: Path) -> tuple[str, ...]:
    if not (proc / "driver" / "nvidia").exists():
        return ()
    command = ["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return ("NVIDIA GPU of unknown model",)
    return tuple(line.strip() for line in answer.stdout.splitlines() if line.strip())
