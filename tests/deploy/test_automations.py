"""Flow runs whose machine is gone are found by their silence and marked as crashed."""

from __future__ import annotations

import datetime
import os
import signal
import sys
import time
from pathlib import Path

import pytest
import yaml

from tests.deploy.conftest import ROOT, Service, background, wait_for

pytestmark = pytest.mark.slow

AUTOMATIONS = ROOT / "deploy" / "automations.yaml"


def test_the_automation_is_stored_once_however_often_it_is_applied(pool: Service) -> None:
    pool.python("deploy/register.py")
    with pool.client() as client:
        [automation] = client.read_automations_by_name("garden-zombie-runs")
    trigger = automation.trigger
    assert automation.enabled
    assert trigger.posture.value == "Proactive"
    assert trigger.after == {"prefect.flow-run.heartbeat"}
    assert trigger.expect == {"prefect.flow-run.*"}
    assert trigger.for_each == {"prefect.resource.id"}
    assert [action.state.value for action in automation.actions] == ["CRASHED"]


def test_its_patience_is_more_than_three_heartbeats() -> None:
    from prefect.settings.models.flows import FlowsSettings

    heartbeat_s = FlowsSettings.model_fields["heartbeat_frequency"].default
    for automation in yaml.safe_load(AUTOMATIONS.read_text())["automations"]:
        assert automation["trigger"]["within"] > 3 * heartbeat_s


def test_a_killed_run_becomes_crashed_and_living_and_finished_ones_do_not(
    service: Service, tmp_path: Path
) -> None:
    document = yaml.safe_load(AUTOMATIONS.read_text())
    document["automations"][0]["name"] = "impatient"
    document["automations"][0]["trigger"]["within"] = 45
    impatient = tmp_path / "automations.yaml"
    impatient.write_text(yaml.safe_dump(document))
    service.python(
        "-c",
        "import sys, pathlib as p, deploy.register as r; r.apply_automations(p.Path(sys.argv[1]))",
        str(impatient),
    )  # fmt: skip
    code = "import sys; from tests.deploy.toy_flow import toy_wait as w; w(float(sys.argv[1]))"
    environment = service.environment | {"PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30"}

    def wait_flow(seconds: float) -> list[str]:
        return [sys.executable, "-c", code, str(seconds)]

    def state_of(name: str) -> str:
        with service.client() as client:
            return str(client.read_flow_run(ids[name]).state.type.value)

    ids = {}
    with (
        background(wait_flow(1.0), environment, tmp_path / "finished.log"),
        background(wait_flow(601.0), environment, tmp_path / "killed.log") as killed,
        background(wait_flow(602.0), environment, tmp_path / "living.log"),
    ):
        seconds = {1.0: "finished", 601.0: "killed", 602.0: "living"}

        def all_started() -> bool:
            with service.client() as client:
                for run in client.read_flow_runs():
                    if run.parameters.get("seconds") in seconds and run.start_time:
                        ids[seconds[run.parameters["seconds"]]] = run.id
            return len(ids) == 3

        wait_for("three runs", all_started, 180)
        wait_for("the short run", lambda: state_of("finished") == "COMPLETED", 60)
        time.sleep(3)  # until the first heartbeat is on the server
        os.killpg(killed.pid, signal.SIGKILL)
        wait_for("the crash", lambda: state_of("killed") == "CRASHED", 180)
        with service.client() as client:
            crashed = client.read_flow_run(ids["killed"])
        assert "No sign of life" in crashed.state.message
        assert state_of("finished") == "COMPLETED"
        assert state_of("living") == "RUNNING"
    assert crashed.state.timestamp - crashed.start_time > datetime.timedelta(seconds=30)
