"""Measure how fast arrays are published, beside plain Zarr made just as durable."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import ClassVar

import numpy as np
import zarr
from jaxtyping import Float, UInt8
from zarr.storage import LocalStore

from storage import Store
from storage.codec.arrays import fill_group
from storage.codec.packing import pack
from storage.codec.tree import encode

GIGABYTE = 10**9
_SYNCING_THREADS = 8  # as many as the store's own


@dataclass(frozen=True)
class DepthStack:
    """Depth maps, colours and points as a dense reconstruction holds them."""

    SCHEMA: ClassVar[str] = "benchmark.DepthStack/1"
    depth: Float[np.ndarray, "v h w"]
    rgb: UInt8[np.ndarray, "v h w 3"]
    points: Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Throughput:
    """MB/s (10^6 bytes of arrays) of both, medians, and the ratio of the medians."""

    megabytes: float
    repeats: int
    published_mb_s: float
    plain_mb_s: float

    @property
    def share(self) -> float:
        """Published as a share of plain, in percent."""
        return 100 * self.published_mb_s / self.plain_mb_s


def depth_stack(total_bytes: int, seed: int = 0) -> DepthStack:
    """Return smooth, noisy depth, colours and points of about ``total_bytes`` in all."""
    generator = np.random.default_rng(seed)
    height, width = 480, 640
    views = max(1, int(0.45 * total_bytes) // (4 * height * width))
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / width
    slopes = generator.uniform(-1, 1, (views, 2, 1, 1)).astype(np.float32)
    depth = 2 + slopes[:, 0] * x + slopes[:, 1] * y
    depth += generator.normal(0, 0.002, depth.shape).astype(np.float32)
    grain = generator.integers(0, 8, (views, height, width, 3), dtype=np.uint8)
    rgb = grain + (100 * (1 + np.sin(9 * x + 7 * y))).astype(np.uint8)[None, :, :, None]
    rest = total_bytes - depth.nbytes - rgb.nbytes
    points = generator.standard_normal((max(1, rest // 12), 3), dtype=np.float32)
    return DepthStack(depth, rgb, points)


def measure_publishing(folder: Path, total_bytes: int = GIGABYTE, repeats: int = 3) -> Throughput:
    """Write the same arrays both ways, taking turns, each into an empty place in ``folder``."""
    ways: dict[str, Callable[[DepthStack, Path], None]] = {
        "published": _publish,
        "plain": write_plain_zarr,
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    size = 0
    for repeat in range(repeats):
        value = depth_stack(total_bytes, seed=repeat)
        size = value.depth.nbytes + value.rgb.nbytes + value.points.nbytes
        for name in sorted(ways, reverse=repeat % 2 == 1):
            place = folder / f"{name}-{repeat}"
            os.sync()  # what others left to write is not this one's time
            started = time.perf_counter()
            ways[name](value, place)
            seconds[name].append(time.perf_counter() - started)
            shutil.rmtree(place)
    rates = {name: size / 1e6 / median(taken) for name, taken in seconds.items()}
    return Throughput(size / 1e6, repeats, rates["published"], rates["plain"])


def write_plain_zarr(value: DepthStack, place: Path) -> None:
    """Write the arrays with Zarr's own store, chunked, sharded and compressed as ours, and
    make every file and folder durable.
    """
    arrays = encode(value).leaves
    root = zarr.create_group(LocalStore(place), zarr_format=3)
    fill_group(root, pack(arrays)[0], arrays)
    files = [path for path in place.rglob("*") if path.is_file()]
    folders = [path for path in place.rglob("*") if path.is_dir()]
    with ThreadPoolExecutor(_SYNCING_THREADS) as pool:
        list(pool.map(_sync, files))
    for path in (*folders, place, place.parent):
        _sync(path)


def _publish(value: DepthStack, place: Path) -> None:
    Store.open(place).publish(value)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
