"""The cluster's manifests: against their schemas, pinned, without secrets, without privileges."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import Any

import kubernetes_validate
import pytest
import yaml

from deploy.register import DEPLOYMENTS, HOME

FOLDER = HOME / "deploy" / "kubernetes"
KUSTOMIZATION = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
MANIFESTS: list[dict[str, Any]] = [
    manifest
    for name in KUSTOMIZATION["resources"]
    for manifest in yaml.safe_load_all((FOLDER / name).read_text())
]
PODS = {
    f"{m['kind']}/{m['metadata']['name']}": m["spec"]["template"]["spec"]
    for m in MANIFESTS
    if "template" in m.get("spec", {})
}
pods = pytest.mark.parametrize("pod", PODS.values(), ids=list(PODS))


@pytest.mark.parametrize(
    "manifest", MANIFESTS, ids=lambda m: f"{m['kind']}/{m['metadata']['name']}"
)
def test_every_manifest_follows_its_schema(manifest: dict[str, Any]) -> None:
    kubernetes_validate.validate(manifest, "1.37", strict=True)


def test_the_schema_check_refuses_a_wrong_field() -> None:
    wrong = MANIFESTS[-1] | {"spec": {"podSelektor": {}}}
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(wrong, "1.37", strict=True)


def test_the_kustomization_lists_every_file() -> None:
    files = {path.name for path in FOLDER.glob("*.yaml")} - {"kustomization.yaml"}
    assert set(KUSTOMIZATION["resources"]) == files


@pytest.mark.skipif(not shutil.which("kubectl"), reason="kubectl is not on this machine")
def test_kubectl_builds_it_and_the_result_follows_the_schemas() -> None:
    built = subprocess.run(
        ["kubectl", "kustomize", str(FOLDER)], capture_output=True, text=True, check=True
    )
    manifests = list(yaml.safe_load_all(built.stdout))
    assert len(manifests) == len(MANIFESTS) + 1
    for manifest in manifests:
        kubernetes_validate.validate(manifest, "1.37", strict=True)
        for container in manifest.get("spec", {}).get("template", {}).get("spec", {}).get(
            "containers", []
        ):  # fmt: skip
            assert re.search(r":[\w.-]*\d", container["image"])


@pods
def test_every_image_is_pinned_by_a_tag(pod: dict[str, Any]) -> None:
    tags = {image["name"]: image["newTag"] for image in KUSTOMIZATION["images"]}
    for container in pod["containers"]:
        name, _, tag = container["image"].partition(":")
        assert re.search(r"\d", tag or tags[name])


@pods
def test_every_pod_runs_without_privileges_and_within_limits(pod: dict[str, Any]) -> None:
    assert pod["automountServiceAccountToken"] is False
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["runAsUser"] > 0
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    for container in pod["containers"]:
        assert container["securityContext"] == {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        }
        assert container["resources"]["limits"]["memory"]
        assert {"cpu", "memory"} <= set(container["resources"]["requests"])


@pods
def test_secrets_are_referred_to_and_never_written_down(pod: dict[str, Any]) -> None:
    for container in pod["containers"]:
        for variable in container.get("env", []):
            if re.search(r"PASSWORD|SECRET|AUTH|KEY_ID", variable["name"]):
                assert set(variable["valueFrom"]) == {"secretKeyRef"}


def test_no_secret_is_among_the_files() -> None:
    assert "Secret" not in {manifest["kind"] for manifest in MANIFESTS}
    for line in (FOLDER / "settings.env").read_text().splitlines():
        assert not re.search(r"PASSWORD|SECRET|AUTH|KEY_ID", line.partition("=")[0])


def test_only_the_gpu_worker_asks_for_a_gpu_and_takes_the_queue_of_gpus() -> None:
    limits = {name: pod["containers"][0]["resources"]["limits"] for name, pod in PODS.items()}
    assert [n for n, limit in limits.items() if "nvidia.com/gpu" in limit] == [
        "Deployment/worker-gpu"
    ]
    queues = {
        d["work_pool"].get("work_queue_name", "default")
        for d in yaml.safe_load(DEPLOYMENTS.read_text())["deployments"]
    }
    commands = [" ".join(pod["containers"][0].get("command", [])) for pod in PODS.values()]
    assert {
        match[1] for line in commands if (match := re.search(r"--work-queue=(\w+)", line))
    } == queues


def test_all_that_comes_in_is_denied_but_what_the_parts_need() -> None:
    policies = {m["metadata"]["name"]: m["spec"] for m in MANIFESTS if m["kind"] == "NetworkPolicy"}
    assert policies["nothing-comes-in"] == {"podSelector": {}, "policyTypes": ["Ingress"]}
    assert policies["server-to-database"]["ingress"][0]["from"] == [
        {"podSelector": {"matchLabels": {"app": "server"}}}
    ]
    clients = {
        name
        for m in MANIFESTS
        if "template" in m.get("spec", {})
        and m["spec"]["template"]["metadata"]["labels"].get("prefect-client") == "true"
        for name in [m["metadata"]["name"]]
    }
    assert clients == {"register", "worker-cpu", "worker-gpu"}
