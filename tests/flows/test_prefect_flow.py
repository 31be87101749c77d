"""Prefect's client waits out a busy server, unless the user says otherwise."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

ASK = (
    "import flows.prefect_flow; from prefect.settings import PREFECT_CLIENT_MAX_RETRIES as n;"
    " print(n.value())"
)


@pytest.mark.parametrize(("given", "tries"), [(None, 8), ("2", 2)])
def test_a_busy_server_is_asked_again(given: str | None, tries: int) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "PREFECT_CLIENT_MAX_RETRIES"}
    if given is not None:
        environment["PREFECT_CLIENT_MAX_RETRIES"] = given
    asked = subprocess.run(
        [sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True
    )
    assert int(asked.stdout) == tries
