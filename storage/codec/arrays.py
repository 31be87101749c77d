"""Write arrays into, and read them from, the one Zarr v3 group of an object.

Chunks are compressed with zstd and carry a crc32c each; empty ones are written too, so
that the manifest's list of members tells empty from missing.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec, ZstdCodec
from zarr.storage import StorePath

from storage.canonical import little_endian
from storage.codec.packing import Pack, Place
from storage.codec.zarr_members import ReadingStore, WritingStore
from storage.errors import CorruptArtifact
from storage.members import MemberReader, MemberWriter

if TYPE_CHECKING:
    from zarr.abc.codec import BytesBytesCodec
    from zarr.core.common import JSON

CHUNK_KEYS: dict[str, JSON] = {"name": "default", "separator": "."}
"""An array's chunks lie side by side: a folder an axis would have to be made, synchronised
and listed for each of them.
"""


def write_arrays(packs: list[Pack], arrays: dict[str, Any], members: MemberWriter) -> None:
    """Write the packed arrays; the root group's metadata is left to the caller."""
    store = WritingStore(members)
    fill_group(zarr.create_group(store, zarr_format=3), packs, arrays)
    store.flush()


def fill_group(root: zarr.Group, packs: list[Pack], arrays: dict[str, Any]) -> None:
    """Write the packed arrays into a Zarr group, wherever it lies."""
    for pack in packs:
        first = arrays[pack.leaves[0]]
        target = root.create_array(
            name=pack.name,
            shape=pack.shape,
            dtype=first.dtype.newbyteorder("<"),
            chunks=pack.chunks,
            shards=pack.shards,
            compressors=_compressors(first.dtype),
            fill_value=False if first.dtype.kind == "b" else 0,
            chunk_key_encoding=CHUNK_KEYS,
            config={"write_empty_chunks": True},
        )
        if 0 not in pack.shape:
            _fill(target, pack, arrays)


def _fill(target: zarr.Array, pack: Pack, arrays: dict[str, Any]) -> None:
    """Write whole shards only: a shard that is written in parts is rewritten each time."""
    if len(pack.leaves) == 1:
        target[...] = little_endian(arrays[pack.leaves[0]])
        return
    if not pack.stacked:
        target[...] = np.concatenate([little_endian(arrays[leaf]) for leaf in pack.leaves])
        return
    step = (pack.shards or pack.chunks)[0]
    for start in range(0, len(pack.leaves), step):
        leaves = pack.leaves[start : start + step]
        target[start : start + len(leaves)] = np.stack([little_endian(arrays[k]) for k in leaves])


def _compressors(dtype: np.dtype[Any]) -> list[BytesBytesCodec]:
    if dtype.itemsize == 1:
        return [ZstdCodec(level=1), Crc32cCodec()]
    blosc = BloscCodec(cname="zstd", clevel=1, shuffle="bitshuffle", typesize=dtype.itemsize)
    return [blosc, Crc32cCodec()]


class ArrayReader:
    """Read the arrays of one object; each Zarr array is opened and decoded once."""

    def __init__(self, members: MemberReader) -> None:
        self._members = members
        self._store = ReadingStore(members)
        self._whole: dict[str, np.ndarray] = {}

    def open(self, name: str) -> zarr.Array:
        """Return a Zarr array to be sliced; CorruptArtifact if it is not there."""
        place = f"{name}/zarr.json"
        if place not in self._members:
            raise CorruptArtifact(self._members.digest, f"array {name} is missing")
        try:
            # Built from its metadata: asking the group for it is three waits for Zarr's thread.
            metadata = json.loads(self._members.get(place))
            return zarr.Array(zarr.AsyncArray.from_dict(StorePath(self._store, name), metadata))
        except (ValueError, TypeError, KeyError) as error:
            raise CorruptArtifact(self._members.digest, f"{name} is no array: {error}") from error

    def leaf(self, place: Place) -> np.ndarray:
        """Return the array that lies at ``place`` (see ``packing.Place``)."""
        if len(place) == 1:
            return self._read(place[0])
        if place[0] not in self._whole:
            self._whole[place[0]] = self._read(place[0])
        whole = self._whole[place[0]]
        if len(place) == 2:
            return np.array(whole[place[1]])
        return whole[place[1] : place[2]].copy()

    def _read(self, name: str) -> np.ndarray:
        try:
            return np.asarray(self.open(name)[...])
        except (ValueError, RuntimeError) as error:  # a checksum or a codec that fails
            raise CorruptArtifact(self._members.digest, f"array {name}: {error}") from error
