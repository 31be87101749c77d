"""Fixtures for all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from garden_models.targets.config import ProposeTargets
from tests.s3_server import S3Server, s3_server
from tests.vlm_server import KEY, KEY_VARIABLE, MODEL, VlmServer, vlm_server


@pytest.fixture(scope="session")
def prefect_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start one Prefect server for the whole session, in a home of its own; give its address."""
    home = tmp_path_factory.mktemp("prefect")
    os.environ.setdefault("PREFECT_HOME", str(home))
    os.environ["PREFECT_SERVER_ANALYTICS_ENABLED"] = "false"
    os.environ["DO_NOT_TRACK"] = "1"
    from prefect.settings import PREFECT_API_URL
    from prefect.testing.utilities import prefect_test_harness

    with prefect_test_harness(server_startup_timeout=120):
        yield str(PREFECT_API_URL.value())


@pytest.fixture(scope="session")
def s3_process() -> Iterator[S3Server]:
    """Start one S3-compatible server for the whole session, on loopback."""
    with s3_server() as server:
        yield server


@pytest.fixture
def s3(s3_process: S3Server, monkeypatch: pytest.MonkeyPatch) -> S3Server:
    """Give the server, and name it in the environment as users do; no request fails yet."""
    for name, value in s3_process.environment.items():
        monkeypatch.setenv(name, value)
    s3_process.fail(0)
    s3_process.counted()
    return s3_process


@pytest.fixture
def vlm(monkeypatch: pytest.MonkeyPatch) -> Iterator[VlmServer]:
    """Give a vision-language model's server on loopback, with its key in the environment."""
    for name in ("GEMINI_API_KEY", "GOOGLE_API_KEY", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    with vlm_server() as running:
        yield running


@pytest.fixture
def vlm_config(vlm: VlmServer) -> ProposeTargets:
    """Give the options that ask that server, with little patience."""
    return ProposeTargets(
        model=MODEL, address=vlm.url, key_variable=KEY_VARIABLE, pause_s=0.01, timeout_s=10.0
    )
