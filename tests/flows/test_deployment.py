"""The deployment points to a flow that exists, with the parameters it is run with."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
import yaml

DEPLOY = Path(__file__).parents[2] / "deploy" / "prefect.yaml"


@pytest.mark.slow
def test_every_deployment_names_a_flow() -> None:
    from prefect import Flow

    for deployment in yaml.safe_load(DEPLOY.read_text())["deployments"]:
        path, name = deployment["entrypoint"].split(":")
        module = importlib.import_module(path.removesuffix(".py").replace("/", "."))
        found = getattr(module, name)
        assert isinstance(found, Flow)
        assert {"capture", "out", "store"} <= set(found.parameters.properties)
