"""Keep artifacts: hash, publish, read, verify, collect.

    from storage import Store

    store = Store.open("store")
    published = store.publish(value)              # any frozen dataclass of arrays
    same = store.read(published.object, type(value))

Importing this package loads neither numpy, zarr nor pyarrow: look-ups need only JSON.
"""

from storage.actions import ActionRecord, Output
from storage.check import Problem
from storage.errors import (
    CorruptArtifact,
    MissingArtifact,
    SchemaMismatch,
    StoreDenied,
    StoreError,
    StoreFormatError,
    StoreFull,
    StoreMissing,
    StoreReadOnly,
    Unstorable,
)
from storage.keep import Keep
from storage.manifest import Manifest
from storage.objects import Published
from storage.pins import Pin
from storage.source import SourceFile
from storage.store import Store

__all__ = [
    "ActionRecord",
    "CorruptArtifact",
    "Keep",
    "Manifest",
    "MissingArtifact",
    "Output",
    "Pin",
    "Problem",
    "Published",
    "SchemaMismatch",
    "SourceFile",
    "Store",
    "StoreDenied",
    "StoreError",
    "StoreFormatError",
    "StoreFull",
    "StoreMissing",
    "StoreReadOnly",
    "Unstorable",
]
