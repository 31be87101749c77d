"""The deployments name flows that exist, with parameters that these take, on one pool."""

from __future__ import annotations

import importlib
import re
from typing import Any

import pytest
import yaml

from deploy.register import DEPLOYMENTS, HOME, POOL, local_timezone

DOCUMENT = yaml.safe_load(DEPLOYMENTS.read_text())
BY_NAME = {deployment["name"]: deployment for deployment in DOCUMENT["deployments"]}


def flow_of(deployment: dict[str, Any]) -> Any:
    path, name = deployment["entrypoint"].split(":")
    module = importlib.import_module(path.removesuffix(".py").replace("/", "."))
    return getattr(module, name)


@pytest.mark.slow
@pytest.mark.parametrize("deployment", BY_NAME.values(), ids=str)
def test_every_deployment_names_a_flow_and_parameters_that_it_takes(
    deployment: dict[str, Any],
) -> None:
    from prefect import Flow

    flow = flow_of(deployment)
    assert isinstance(flow, Flow)
    given = set(deployment.get("parameters", {}))
    assert given <= set(flow.parameters.properties)
    if "schedules" in deployment:
        assert set(flow.parameters.required) <= given, "a schedule has nobody to ask"


@pytest.mark.slow
def test_prefect_reads_it_without_leaving_anything_out() -> None:
    from prefect.cli.deploy._models import DeploymentConfig, PrefectYamlModel

    model = PrefectYamlModel.model_validate(DOCUMENT)
    assert [deployment.name for deployment in model.deployments] == list(BY_NAME)
    for deployment in DOCUMENT["deployments"]:
        assert set(deployment) <= set(DeploymentConfig.model_fields)
    assert set(DOCUMENT) - {"definitions"} <= {
        field.alias or name for name, field in PrefectYamlModel.model_fields.items()
    }


def test_all_run_in_one_process_pool_and_one_of_them_waits_for_a_gpu() -> None:
    pools = {name: deployment["work_pool"] for name, deployment in BY_NAME.items()}
    assert {pool["name"] for pool in pools.values()} == {POOL}
    queues = {name for name, pool in pools.items() if pool.get("work_queue_name") == "gpu"}
    assert queues == {"factorize-gpu"}


def test_what_is_scheduled_is_never_run_twice_at_once() -> None:
    for deployment in BY_NAME.values():
        if "schedules" in deployment:
            assert deployment["concurrency_limit"]["limit"] == 1


@pytest.mark.parametrize(
    ("name", "cron"),
    [
        ("collection", "0 1 * * *"),
        ("latency", "0 7 * * 6"),
        ("store-maintenance", "0 12 * * 6"),
    ],
)
def test_nightly_and_weekly_schedules(name: str, cron: str) -> None:
    [schedule] = BY_NAME[name]["schedules"]
    assert schedule["cron"] == cron


def test_the_documentation_tells_of_every_deployment_and_of_no_other() -> None:
    text = (HOME / "docs" / "deploy.md").read_text()
    told = re.findall(r"^\| `[\w-]+/([\w-]+)` \|", text, re.MULTILINE)
    assert told == list(BY_NAME)


def test_this_machine_has_a_time_zone() -> None:
    from zoneinfo import ZoneInfo

    assert ZoneInfo(local_timezone())
