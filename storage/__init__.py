"""Keep artifacts: hash, publish, read, verify, collect.

    from storage import Store

    store = Store.open("store")
    published = store.publish(value)              # any frozen dataclass of arrays
    same = store.read(published.object, type(value))

What this package gives is loaded when it is used: look-ups need neither numpy, zarr nor
pyarrow, and who takes values apart (``storage.codec.tree``) needs nothing of the rest.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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

_HOMES = {
    "actions": (
        "ActionRecord",
        "Output",
    ),
    "check": ("Problem",),
    "errors": (
        "CorruptArtifact",
        "MissingArtifact",
        "SchemaMismatch",
        "StoreDenied",
        "StoreError",
        "StoreFormatError",
        "StoreFull",
        "StoreMissing",
        "StoreReadOnly",
        "Unstorable",
    ),
    "keep": ("Keep",),
    "manifest": ("Manifest",),
    "objects": ("Published",),
    "pins": ("Pin",),
    "source": ("SourceFile",),
    "store": ("Store",),
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"storage.{_MODULES[name]}"), name)
    globals()[name] = found
    return found
