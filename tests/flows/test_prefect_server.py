"""A program without a configured server has one of its own, which ends with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import httpx
import pytest

PROGRAM = """
import sys, time
from flows.prefect_server import _started, at_server, begin_server
begin_server()
print(len(_started), "prefect" in sys.modules, flush=True)
with at_server() as address:
    print(address, flush=True)
    time.sleep(600 if len(sys.argv) > 1 else 0)
"""


def program(environment: Mapping[str, str], *arguments: str) -> subprocess.Popen[str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *arguments],
        env=kept | dict(environment),
        stdout=subprocess.PIPE,
        text=True,
    )


def answers(address: str) -> bool:
    try:
        return httpx.get(f"{address}/health", timeout=30.0).status_code == httpx.codes.OK
    except httpx.HTTPError:
        return False


@pytest.mark.parametrize("how", ["ends", "is killed"])
def test_it_is_begun_before_prefect_is_imported_and_ends_with_the_program(
    tmp_path: Path, how: str
) -> None:
    running = program({"PREFECT_HOME": str(tmp_path)}, *(["stay"] if how == "is killed" else []))
    assert running.stdout is not None
    assert running.stdout.readline().split() == ["1", "False"]
    address = running.stdout.readline().strip()
    if how == "is killed":
        assert answers(address)
        running.send_signal(signal.SIGKILL)
    running.wait(timeout=120)
    running.stdout.close()
    deadline = time.monotonic() + 60
    while answers(address):
        assert time.monotonic() < deadline, "it outlives its program"
        time.sleep(0.1)


def test_one_that_is_configured_is_used(tmp_path: Path, prefect_server: str) -> None:
    told = program({"PREFECT_HOME": str(tmp_path), "PREFECT_API_URL": prefect_server})
    assert told.communicate(timeout=120)[0].split() == ["0", "False", prefect_server]
