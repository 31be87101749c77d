"""Make a collection one flow run, and have its workers report to the same Prefect server."""

from __future__ import annotations

from collections.abc import Callable

from flows.collection.prefect_server import server_address
from flows.prefect_flow import collection_flow, of_collection


def in_collection_flow(name: str, body: Callable[[], None], environment: dict[str, str]) -> None:
    """Run ``body`` as the flow run of a collection.

    ``environment`` is that of the processes which it starts: they are told the server.
    """
    from prefect.settings import PREFECT_API_URL, temporary_settings

    def run() -> None:
        body()

    address = server_address()
    environment["PREFECT_API_URL"] = address
    with temporary_settings({PREFECT_API_URL: address}), of_collection(name):
        collection_flow(name)(run)()
