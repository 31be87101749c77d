"""Divide a long capture into overlapping chunks that a model can read at once."""

from __future__ import annotations

from math import ceil


def photo_chunks(photos: int, size: int, overlap: int) -> tuple[range, ...]:
    """Return chunks of at most ``size`` consecutive photos; neighbours share ``overlap`` or more.

    All have the same length and lie evenly. Raises ValueError if ``size`` does not exceed
    ``overlap``.
    """
    if photos <= size:
        return (range(photos),)
    if size <= overlap:
        raise ValueError(f"chunks of {size} photos cannot share {overlap}")
    count = ceil((photos - overlap) / (size - overlap))
    starts = [k * (photos - size) // (count - 1) for k in range(count)]
    return tuple(range(start, start + size) for start in starts)


def owners(chunks: tuple[range, ...], photos: int) -> tuple[int, ...]:
    """Return, for each photo, the chunk in which it lies deepest: the one that saw most of
    its surroundings.
    """

    def depth(chunk: range, photo: int) -> int:
        first = chunk.start if chunk.start > 0 else -photos
        last = chunk.stop - 1 if chunk.stop < photos else 2 * photos
        return min(photo - first, last - photo)

    holding = [[c for c, chunk in enumerate(chunks) if p in chunk] for p in range(photos)]
    return tuple(max(held, key=lambda c: depth(chunks[c], p)) for p, held in enumerate(holding))
