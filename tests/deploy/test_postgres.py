"""PostgreSQL behind the Prefect server, as docs/deploy.md sets it up for several workers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.deploy.conftest import Service, prefect_service, wait_for
from tests.deploy.postgres import Database, database, query

pytestmark = pytest.mark.slow

AUTH = "garden:only-for-this-test"
TASKS = 40


@pytest.fixture(scope="module")
def postgres(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    with database(tmp_path_factory.mktemp("postgres")) as running:
        yield running


@pytest.fixture(scope="module")
def shared(postgres: Database, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A server with the settings that compose and Kubernetes give it."""
    settings = {
        "PREFECT_SERVER_DATABASE_DRIVER": "postgresql+asyncpg",
        "PREFECT_SERVER_DATABASE_HOST": "127.0.0.1",
        "PREFECT_SERVER_DATABASE_PORT": str(postgres.port),
        "PREFECT_SERVER_DATABASE_NAME": postgres.name,
        "PREFECT_SERVER_DATABASE_USER": postgres.user,
        "PREFECT_SERVER_DATABASE_PASSWORD": postgres.password,
        "PREFECT_SERVER_API_AUTH_STRING": AUTH,
        "PREFECT_API_AUTH_STRING": AUTH,
    }
    with prefect_service(tmp_path_factory.mktemp("shared"), **settings) as running:
        yield running


def test_every_task_run_of_two_clients_at_once_is_a_row(
    shared: Service, postgres: Database, tmp_path: Path
) -> None:
    from concurrent.futures import ThreadPoolExecutor

    code = "import sys; from tests.deploy.toy_flow import toy_many as t; "
    code += "t(int(sys.argv[1]), sys.argv[2])"
    with ThreadPoolExecutor(2) as clients:
        list(
            clients.map(
                lambda name: shared.python("-c", code, str(TASKS // 2), str(tmp_path / name)),
                ("one", "two"),
            )
        )
    rows = wait_for(
        "all rows",
        lambda: (
            (rows := query(postgres, "SELECT state_type::text, count(*) FROM task_run GROUP BY 1"))
            == [("COMPLETED", TASKS)]
            and rows
        ),
        180,
    )
    assert rows == [("COMPLETED", TASKS)]
    assert query(postgres, "SELECT state_type::text FROM flow_run") == [("COMPLETED",)] * 2
    assert ("pg_trgm",) in query(postgres, "SELECT extname FROM pg_extension")
    assert not (shared.home / "prefect.db").exists()


def test_who_has_no_password_is_refused_and_registering_works_with_it(shared: Service) -> None:
    import httpx

    assert httpx.get(f"{shared.api}/health").is_success
    assert httpx.post(f"{shared.api}/deployments/filter", json={}).status_code == 401
    printed = shared.python("deploy/register.py")
    assert "factorize-gpu" in printed
    assert "garden-zombie-runs" in printed
    assert AUTH not in printed
