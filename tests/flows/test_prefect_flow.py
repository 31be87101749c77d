"""Prefect's client waits out a busy server, and sends heartbeats only where they are heard."""

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


IN_FLOW = """
from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY as frequency
from flows.prefect_flow import scene_flow
scene_flow("room")(lambda: print(frequency.value()))()
"""


@pytest.mark.parametrize(
    ("given", "frequency"),
    [
        ({}, "None"),
        ({"PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30"}, "30"),
        ({"PREFECT__FLOW_RUN_ID": "1b2f4ef5-1c37-4bd5-8f33-6a9e7b0b1d2a"}, "180"),
    ],
    ids=["by itself", "asked for", "in a deployment"],
)
def test_heartbeats_are_sent_where_they_are_heard(
    prefect_server: str, given: dict[str, str], frequency: str
) -> None:
    environment = os.environ | {"PREFECT_API_URL": prefect_server} | given
    told = subprocess.run(
        [sys.executable, "-c", IN_FLOW], env=environment, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == frequency
