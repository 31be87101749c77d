"""Keep a store under its quota while runs publish into it.

What a run is about to compute needs room. At the high-water mark the longest unused results
are collected first; if that does not help, the step fails before it has begun.
"""

from __future__ import annotations

import os
import threading
import time

from storage.catalogue import read_columns
from storage.collect import collect
from storage.errors import StoreError, StoreFull
from storage.keep import Keep
from storage.medium import Medium
from storage.quantities import parse_bytes, show_bytes

VARIABLE = "GARDEN_STORE_QUOTA"
HIGH_WATER, LOW_WATER = 0.9, 0.8  # of the quota: where a collection begins, and aims at
GRACE_S = 3600.0  # runs in progress hold their scenes by pins besides
_LOOK_AGAIN_S = 60.0


def configured_quota() -> int | None:
    """Return the quota (bytes) that the environment sets; StoreError if it is no size."""
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return None
    try:
        return parse_bytes(text)
    except ValueError as error:
        raise StoreError(f"{VARIABLE}: {error}") from None


class Quota:
    """The room that one store may take, as one process sees it (thread-safe)."""

    def __init__(self, medium: Medium, quota_bytes: int) -> None:
        self.bytes = quota_bytes
        self._medium = medium
        self._guard = threading.Lock()
        self._taken = 0
        self._looked = -_LOOK_AGAIN_S
        self._collected = -_LOOK_AGAIN_S

    def make_room(self) -> None:
        """Collect if the store has come near its quota.

        Raises:
            StoreFull: it is at its quota, and nothing more may be forgotten.
        """
        with self._guard:
            now = time.monotonic()
            if now - self._looked >= _LOOK_AGAIN_S or self._taken >= self.bytes:
                self._look(now)
            if self._taken < HIGH_WATER * self.bytes:
                return
            if now - self._collected >= _LOOK_AGAIN_S:
                self._collected = now
                aim = int(LOW_WATER * self.bytes)
                done = collect(self._medium, Keep(), quota_bytes=aim, grace_s=GRACE_S)
                self._taken = done.bytes_left
            if self._taken >= self.bytes:
                raise StoreFull(
                    f"the store {self._medium.address} takes {show_bytes(self._taken)} of its"
                    f" quota of {show_bytes(self.bytes)}, and all of it is pinned or was used"
                    f" within the last hour: raise {VARIABLE}, unpin something (`garden store"
                    " pins`), or choose another store with --store"
                )

    def add(self, size: int) -> None:
        """Take notice of bytes that were published."""
        with self._guard:
            self._taken += size

    def _look(self, now: float) -> None:
        self._looked = now
        sizes = dict(read_columns(self._medium, "object", "bytes"))
        self._taken = sum(sizes.values())
