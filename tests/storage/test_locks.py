"""Locks: together or alone, in turn, and never waited for without end."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from storage import Store
from storage.locks import alone, shared
from tests.storage.history import key_of


def test_locks_die_with_owners_no_wait_is_without_a_bound(tmp_path: Path) -> None:
    """A process that is stopped while it holds a lock makes others fail, not hang."""
    place = tmp_path / "gc.lock"
    held, late = shared(place), alone(place, 0.05)
    with held, shared(place), pytest.raises(TimeoutError, match="another process"), late:
        pass
    with alone(place):
        for wait in (shared, alone):
            with pytest.raises(TimeoutError, match="fuser"), wait(place, 0.05):
                pass
    with alone(place):
        pass


def test_one_who_waits_to_be_alone_is_not_overtaken(tmp_path: Path) -> None:
    place = tmp_path / "gc.lock"
    order: list[str] = []

    def enter(how: str) -> None:
        with (alone if how == "alone" else shared)(place):
            order.append(how)

    threads = []
    with shared(place):
        for how in ("alone", "shared"):
            threads.append(threading.Thread(target=enter, args=[how]))
            threads[-1].start()
            waiting = time.monotonic() + 0.2
            while time.monotonic() < waiting:
                time.sleep(0.01)
        assert order == []
    for thread in threads:
        thread.join()
    assert order == ["alone", "shared"]


def test_a_dead_holder_holds_nothing(store: Store) -> None:
    import subprocess
    import sys

    code = (
        "import os, sys; from storage import Store\n"
        "with Store.open(sys.argv[1]).medium.collecting(): os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(store.path)], check=False)
    with store.medium.publishing():
        assert store.lookup(key_of("a")) == (None, "absent")
