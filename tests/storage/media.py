"""Run a test of what every store promises over each medium, and damage what stands there."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import pytest

from storage import Store
from storage.bucket import object_prefix
from tests.s3_server import BUCKET, S3Server

on_any_medium = pytest.mark.parametrize("store", ("folder", "bucket"), indirect=True)
on_any_medium_slowly = pytest.mark.parametrize(
    "store", ("folder", pytest.param("bucket", marks=pytest.mark.slow)), indirect=True
)


class Behind(Protocol):
    """What stands in a store, behind its back."""

    def names(self, prefix: str) -> list[str]: ...

    def get(self, name: str) -> bytes: ...

    def put(self, name: str, data: bytes) -> None: ...

    def delete(self, name: str) -> None: ...


class BehindFolder:
    def __init__(self, path: Path) -> None:
        self.path = path

    def names(self, prefix: str) -> list[str]:
        files = (p for p in (self.path / prefix).rglob("*") if p.is_file())
        return sorted(str(p.relative_to(self.path)) for p in files)

    def get(self, name: str) -> bytes:
        return (self.path / name).read_bytes()

    def put(self, name: str, data: bytes) -> None:
        place = self.path / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.unlink(missing_ok=True)
        place.write_bytes(data)

    def delete(self, name: str) -> None:
        (self.path / name).unlink()


class BehindBucket:
    def __init__(self, address: str) -> None:
        self.server = S3Server(urlsplit(os.environ["AWS_ENDPOINT_URL"]).port or 0)
        self.prefix = address.removeprefix(f"s3://{BUCKET}/") + "/"

    def names(self, prefix: str) -> list[str]:
        return [n.removeprefix(self.prefix) for n in self.server.names(self.prefix + prefix)]

    def get(self, name: str) -> bytes:
        return self.server.get(self.prefix + name)

    def put(self, name: str, data: bytes) -> None:
        self.server.put(self.prefix + name, data)

    def delete(self, name: str) -> None:
        self.server.delete(self.prefix + name)


def behind(store: Store) -> Behind:
    if store.address.startswith("s3://"):
        return BehindBucket(store.address)
    return BehindFolder(store.path)


def files_of(store: Store, digest: str) -> list[str]:
    """Return the names of an object's files."""
    return behind(store).names(object_prefix(digest))


def lose(store: Store, digest: str) -> None:
    """Remove all of an object."""
    for name in files_of(store, digest):
        behind(store).delete(name)
    if isinstance(there := behind(store), BehindFolder):
        _remove_empty(there.path / object_prefix(digest))


def _remove_empty(folder: Path) -> None:
    for inside in folder.iterdir():
        _remove_empty(inside)
    folder.rmdir()
