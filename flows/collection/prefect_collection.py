"""Make a collection one flow run, and have its workers report to the same Prefect server."""

from __future__ import annotations

from collections.abc import Callable

from flows.prefect_flow import collection_flow, of_collection
from flows.prefect_server import at_server


def in_collection_flow(name: str, body: Callable[[], None], environment: dict[str, str]) -> None:
    """Run ``body`` as the flow run of a collection.

    ``environment`` is that of the processes which it starts: they are told the server.
    """

    def run() -> None:
        body()

    with at_server() as address, of_collection(name):
        environment["PREFECT_API_URL"] = address
        collection_flow(name)(run)()
