"""Write small PNG files: 1-bit masks and 16-bit depth maps (PNG specification, 3rd ed.)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_mask(path: Path, mask: NDArray[np.bool_]) -> None:
    """Write a mask ``(h, w)`` as a 1-bit grey PNG; True is white."""
    rows = np.packbits(mask, axis=1)
    _write(path, rows, mask.shape[1], bit_depth=1, pixel_bytes=1)


def write_grey16(path: Path, image: NDArray[np.uint16]) -> None:
    """Write ``(h, w)`` as a 16-bit grey PNG."""
    rows = image.astype(">u2").view(np.uint8).reshape(image.shape[0], -1)
    _write(path, rows, image.shape[1], bit_depth=16, pixel_bytes=2)


def _write(
    path: Path, rows: NDArray[np.uint8], width: int, bit_depth: int, pixel_bytes: int
) -> None:
    header = struct.pack(">IIBBBBB", width, len(rows), bit_depth, 0, 0, 0, 0)
    data = zlib.compress(_filtered(rows, pixel_bytes), 9)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, body in chunks:
            file.write(struct.pack(">I", len(body)) + kind + body)
            file.write(struct.pack(">I", zlib.crc32(kind + body)))


def _filtered(rows: NDArray[np.uint8], pixel_bytes: int) -> bytes:
    """Filter each row by the predictor with the least absolute sum (heuristic of the
    specification, section 12.7).
    """
    out = bytearray()
    above = np.zeros(rows.shape[1], dtype=np.int64)
    for row in rows.astype(np.int64):
        left = np.concatenate([np.zeros(pixel_bytes, dtype=np.int64), row[:-pixel_bytes]])
        corner = np.concatenate([np.zeros(pixel_bytes, dtype=np.int64), above[:-pixel_bytes]])
        guess = left + above - corner
        to_left, to_above, to_corner = (np.abs(guess - p) for p in (left, above, corner))
        paeth = np.where(
            (to_left <= to_above) & (to_left <= to_corner),
            left,
            np.where(to_above <= to_corner, above, corner),
        )
        predictions = (np.zeros_like(row), left, above, (left + above) // 2, paeth)
        options = [((row - p) % 256).astype(np.uint8) for p in predictions]
        cost = [int(np.abs(o.astype(np.int8).astype(np.int64)).sum()) for o in options]
        best = int(np.argmin(cost))
        out.append(best)
        out += options[best].tobytes()
        above = row
    return bytes(out)
