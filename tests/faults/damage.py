"""Damage one file of a store behind its back."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from tests.storage.media import Behind, BehindFolder

Kind = Literal["flip", "cut", "empty", "longer", "missing", "extra", "swapped", "lost", "hollow"]
EXTRA = ("extra", "c/extra", ".hidden", "zarr.json/extra")


@dataclass(frozen=True)
class Damage:
    """What happens to the file ``name``, or to the object ``name`` as a whole.

    ``at`` is the bit that is flipped, or the bytes that are left; ``other`` is the file that
    ``name`` is swapped with. A lost object is gone; of a hollow one, in a folder, the empty
    folders stay.
    """

    kind: Kind
    name: str
    at: int = 0
    other: str = ""

    def do(self, store: Behind) -> None:
        """Damage the file."""
        if self.kind == "missing":
            store.delete(self.name)
        elif self.kind in ("lost", "hollow"):
            for name in store.names(self.name):
                store.delete(name)
            if self.kind == "lost" and isinstance(store, BehindFolder):
                shutil.rmtree(store.path / self.name)
        elif self.kind == "extra":
            store.put(self.name, b"more")
        elif self.kind == "swapped":
            one, two = store.get(self.name), store.get(self.other)
            store.put(self.name, two)
            store.put(self.other, one)
        else:
            store.put(self.name, self._changed(store.get(self.name)))

    def _changed(self, data: bytes) -> bytes:
        if self.kind == "flip":
            changed = bytearray(data)
            at = self.at % (8 * len(data))  # a record that was made again may be shorter
            changed[at // 8] ^= 1 << (at % 8)
            return bytes(changed)
        if self.kind == "cut":
            return data[: min(self.at, len(data) - 1)]
        return data + b"\0" if self.kind == "longer" else b""


def damages_of_file(
    store: Behind, name: str, flips: int, chance: random.Random
) -> Iterator[Damage]:
    """Give all kinds of damage to one file, with ``flips`` flipped bits."""
    size = len(store.get(name))
    for _ in range(flips if size else 0):
        yield Damage("flip", name, chance.randrange(8 * size))
    if size:
        yield Damage("cut", name, size - 1)
        yield Damage("empty", name)
    if size > 2:
        yield Damage("cut", name, size // 2)
    yield Damage("longer", name)
    yield Damage("missing", name)


def damages_of_object(
    store: Behind, prefix: str, flips: int, chance: random.Random
) -> Iterator[Damage]:
    """Give all kinds of damage to each file of an object, and to the whole of it."""
    names = store.names(prefix)
    for name in names:
        yield from damages_of_file(store, name, flips, chance)
    for name in EXTRA:
        if "/" not in name or f"{prefix}/{name.partition('/')[0]}" not in names:
            yield Damage("extra", f"{prefix}/{name}")
    members = [name for name in names if not name.endswith("/manifest.json")]
    for one, two in pairwise(members):
        if store.get(one) != store.get(two):
            yield Damage("swapped", one, other=two)
    yield Damage("lost", prefix)
    yield Damage("hollow", prefix)
