"""The Dockerfile and the compose file: against their schemas, pinned, and without secrets."""

from __future__ import annotations

import fnmatch
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from deploy.register import DEPLOYMENTS, HOME

DEPLOY = HOME / "deploy"
COMPOSE = DEPLOY / "compose.yaml"
SERVICES: dict[str, Any] = yaml.safe_load(COMPOSE.read_text())["services"]
PINNED = re.compile(r"^[\w./-]+:[\w.-]*\d[\w.-]*$")
OURS = {"server", "register", "worker-cpu", "worker-gpu"}
STAGE = re.compile(r"^FROM (?P<image>\S+) AS (?P<stage>\S+)$", re.MULTILINE)


def tool(name: str) -> str:
    """Return a command that the test extra brings."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    assert found, f"{name} is missing: install the extra 'dev'"
    return found


def test_compose_follows_the_compose_specification(tmp_path: Path) -> None:
    check = [tool("check-jsonschema"), "--builtin-schema", "vendor.compose-spec"]
    assert subprocess.run([*check, str(COMPOSE)], check=False).returncode == 0
    broken = tmp_path / "compose.yaml"
    broken.write_text(COMPOSE.read_text().replace("restart:", "restrat:"))
    assert subprocess.run([*check, str(broken)], check=False, capture_output=True).returncode == 1


def test_the_dockerfile_passes_hadolint(tmp_path: Path) -> None:
    lint = [tool("hadolint")]
    assert subprocess.run([*lint, str(DEPLOY / "Dockerfile")], check=False).returncode == 0
    broken = tmp_path / "Dockerfile"
    broken.write_text("FROM python:latest\nRUN cd /tmp\n")
    refused = subprocess.run([*lint, str(broken)], check=False, capture_output=True)
    assert refused.returncode == 1


def test_every_image_is_pinned_by_a_tag() -> None:
    for name, service in SERVICES.items():
        assert PINNED.match(service["image"]), name
    stages = STAGE.findall((DEPLOY / "Dockerfile").read_text())
    names = {stage for _, stage in stages}
    for image, stage in stages:
        assert image in names or PINNED.match(image), stage


def test_every_target_that_compose_builds_is_a_stage() -> None:
    stages = {stage for _, stage in STAGE.findall((DEPLOY / "Dockerfile").read_text())}
    targets = {service["build"]["target"] for service in SERVICES.values() if "build" in service}
    assert targets == {"cpu", "gpu"} <= stages


def test_secrets_come_from_outside_and_are_asked_for() -> None:
    example = (DEPLOY / "env.example").read_text()
    for name, service in SERVICES.items():
        for key, value in service.get("environment", {}).items():
            if re.search(r"PASSWORD|SECRET|AUTH|KEY_ID|ROOT_USER", key):
                variable = re.fullmatch(r"\$\{(\w+):\?.+\}", value)
                assert variable, f"{name}: {key} is written down"
                assert re.search(rf"^{variable[1]}=$", example, re.MULTILINE), variable[1]
    assert "/deploy/.env" in (HOME / ".gitignore").read_text().splitlines()


def test_ports_are_published_on_loopback_only() -> None:
    published = [port for service in SERVICES.values() for port in service.get("ports", [])]
    assert published
    assert all(port.startswith("127.0.0.1:") for port in published)


@pytest.mark.parametrize("name", sorted(SERVICES))
def test_nothing_gains_privileges_and_lasting_services_are_watched(name: str) -> None:
    service = SERVICES[name]
    assert service["security_opt"] == ["no-new-privileges:true"]
    if "restart" in service:
        assert service["healthcheck"]["test"]
    if name in OURS:
        assert service["read_only"] is True
        assert service["cap_drop"] == ["ALL"]


def test_workers_take_every_queue_that_a_deployment_names() -> None:
    pools = [d["work_pool"] for d in yaml.safe_load(DEPLOYMENTS.read_text())["deployments"]]
    wanted = {pool.get("work_queue_name", "default") for pool in pools}
    served = {
        service["command"][service["command"].index("--work-queue") + 1]
        for name, service in SERVICES.items()
        if name.startswith("worker")
    }
    assert served == wanted


def test_the_image_holds_what_a_worker_needs_and_no_local_files() -> None:
    kept = [
        line[1:]
        for line in (DEPLOY / "Dockerfile.dockerignore").read_text().splitlines()
        if line.startswith("!")
    ]

    def is_kept(path: str) -> bool:
        return any(path == k or path.startswith(f"{k}/") or fnmatch.fnmatch(path, k) for k in kept)

    for needed in (
        "pyproject.toml",
        "deploy/register.py",
        "deploy/prefect.yaml",
        "flows/preset.py",
    ):
        assert (HOME / needed).exists()
        assert is_kept(needed)
    for foreign in ("deploy/.env", ".git", ".venv", "scenes"):
        assert not is_kept(foreign)
