"""LOCKS-DIE-WITH-OWNERS: one owner at a time, and none that outlives its process."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

from storage import Store
from storage.digest import digest_value
from tests.storage.media import behind, on_any_medium

KEY = digest_value("key", domain="test/1")


@on_any_medium
def test_only_one_holds_a_lease(store: Store) -> None:
    lease = store.acquire(KEY)
    assert lease is not None
    assert store.acquire(KEY) is None
    assert store.leases.holder(KEY) == lease
    store.leases.release(lease)
    assert store.leases.holder(KEY) is None
    again = store.acquire(KEY)
    assert again is not None
    store.leases.release(lease)  # not ours any more: nothing happens
    assert store.leases.holder(KEY) == again


@on_any_medium
def test_of_many_racing_threads_one_wins(store: Store) -> None:
    won: list[object] = []
    start = threading.Barrier(8)

    def race() -> None:
        start.wait()
        lease = Store.open(store.address).acquire(KEY)
        if lease is not None:
            won.append(lease)

    threads = [threading.Thread(target=race) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1


@on_any_medium
def test_a_dead_owners_lease_is_taken_over_at_once(store: Store) -> None:
    code = (
        "import os, sys; from storage import Store\n"
        f"assert Store.open(sys.argv[1]).acquire({KEY!r}); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, store.address], check=False)
    assert behind(store).names("leases/")
    assert store.leases.holder(KEY) is None
    assert store.acquire(KEY) is not None


@on_any_medium
def test_a_lease_that_is_not_renewed_ends(store: Store) -> None:
    store = Store.open(store.address, lease_s=0.3)
    lease = store.acquire(KEY)
    assert lease is not None
    store.leases.abandon_all()
    assert store.acquire(KEY) is None
    time.sleep(0.4)
    assert store.acquire(KEY) is not None


@on_any_medium
def test_a_lease_is_renewed_while_its_owner_works(store: Store) -> None:
    store = Store.open(store.address, lease_s=0.3)
    assert store.acquire(KEY) is not None
    time.sleep(0.8)
    assert Store.open(store.address).acquire(KEY) is None
