"""A process that shares only a bucket with others: ``python -m tests.storage.bucket_worker``.

It says ``ready`` when it has opened the store, and begins when it is sent a line.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable

from storage import Store
from storage.digest import digest_value
from tests.storage.samples import scene
from tests.storage.test_store import record_of

THREADS = 4
KEY = digest_value("raced", domain="test/1")


def create(store: Store, name: str) -> None:
    """Race to create one document and one lease; print who won what."""

    def race(number: int) -> None:
        mine = f"{name}-{number}"
        start.wait()
        if store.medium.create("pins/raced", mine.encode()):
            print(f"document {mine}", flush=True)
        if Store.open(store.address).acquire(KEY) is not None:
            print(f"lease {mine}", flush=True)

    start = threading.Barrier(THREADS)
    threads = [threading.Thread(target=race, args=(n,)) for n in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print("done", flush=True)
    time.sleep(60)  # a lease whose owner is gone could be taken over


def publish(store: Store, name: str) -> None:
    """Publish and record without end: some that others publish too, some of its own."""
    seed = 0
    while True:
        value = scene(seed if seed % 2 else hash(name) % 1000 + seed)
        store.record(record_of(store, value, name=f"{seed}" if seed % 2 else f"{name}{seed}"))
        seed += 1


WORK: dict[str, Callable[[Store, str], None]] = {"create": create, "publish": publish}


def main() -> None:
    work, address, name = sys.argv[1:]
    store = Store.open(address)
    print("ready", flush=True)
    sys.stdin.readline()
    WORK[work](store, name)


if __name__ == "__main__":
    main()
