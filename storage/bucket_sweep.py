"""Remove from a bucket what the dead left unfinished, when nobody can be at it any more."""

from __future__ import annotations

import time
from itertools import groupby

from storage.bucket_client import BucketClient
from storage.manifest import MANIFEST
from storage.object_names import OBJECTS, prefix_of

UNFINISHED_FOR_S = 24 * 3600.0


def sweep(bucket: BucketClient) -> int:
    """Remove members that have had no manifest for a day, and leases that ended a day ago.

    Returns how many objects and leases that were.
    """
    before = time.time() - UNFINISHED_FOR_S
    swept = 0
    for place, group in groupby(bucket.list(OBJECTS), lambda entry: prefix_of(entry.name)):
        entries = list(group)
        names = [entry.name for entry in entries]
        if place + MANIFEST in names or max(entry.modified for entry in entries) > before:
            continue
        if not _exists(bucket, place + MANIFEST):  # as of now, not of the listing
            bucket.delete(names)
            swept += 1
    ended = [entry.name for entry in bucket.list("leases/") if entry.modified < before]
    bucket.delete(ended)
    return swept + len(ended)


def _exists(bucket: BucketClient, name: str) -> bool:
    try:
        bucket.head(name)
    except FileNotFoundError:
        return False
    return True
