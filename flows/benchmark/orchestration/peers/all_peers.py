"""List the peers, in the order of the table."""

from __future__ import annotations

import importlib.util

from flows.benchmark.orchestration.peers.garden_steps import (
    local_steps,
    local_steps_read,
    prefect_steps,
)
from flows.benchmark.orchestration.peers.joblib_memory import joblib_memory
from flows.benchmark.orchestration.peers.peer import Peer
from flows.benchmark.orchestration.peers.plain_python import plain_python
from flows.benchmark.orchestration.peers.prefect_cache import prefect_cache
from flows.benchmark.orchestration.peers.redun_scheduler import redun_scheduler

PLAIN, JOBLIB = "plain Python", "joblib.Memory"
STEPS, STEPS_READ = "garden steps", "garden steps, values read"

PEERS = (
    Peer(PLAIN, plain_python, "runs again", caches=False),
    Peer(STEPS, local_steps, "verified reference"),
    Peer(STEPS_READ, local_steps_read, "verified reference and value"),
    Peer(JOBLIB, joblib_memory, "value, unverified", package="joblib"),
    Peer("redun", redun_scheduler, "value, unverified", package="redun"),
    Peer("garden steps in Prefect", prefect_steps, "verified reference", on_server=True),
    Peer("Prefect's cache", prefect_cache, "value, unverified", on_server=True),
)


class PeerMissing(RuntimeError):
    """A package to compare with is not installed."""


def check_installed(peers: tuple[Peer, ...]) -> None:
    """Raise PeerMissing, with what to install, if a peer's package is not there."""
    missing = [p.package for p in peers if p.package and not importlib.util.find_spec(p.package)]
    if missing:
        raise PeerMissing(
            f"{' and '.join(missing)} to compare with: not installed; install them with"
            " `pip install -c constraints.txt -e '.[benchmark]'`"
        )
