"""Run a job for many photos side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Protocol, TypeVar

import torch

Result = TypeVar("Result")


class RunForPhotos(Protocol):
    """Call ``job`` for each index; report how many are done; return results by index."""

    def __call__(
        self, job: Callable[[int], Result], indices: list[int], done: Callable[[int], None]
    ) -> dict[int, Result]:
        """Run it."""
        ...


@contextmanager
def photo_pool(device: torch.device) -> Iterator[RunForPhotos]:
    """Yield a function that runs jobs for many photos, one photo per torch thread.

    Photos are independent within a stage: run side by side with one torch thread each they
    use the processors better than torch's own threads do, with the same result. On an
    accelerator they run one after the other.
    """
    threads = torch.get_num_threads()
    pool = ThreadPoolExecutor(
        max_workers=threads if device.type == "cpu" else 1,
        initializer=torch.set_num_threads,
        initargs=(1,),
    )

    def run(
        job: Callable[[int], Result], indices: list[int], done: Callable[[int], None]
    ) -> dict[int, Result]:
        results = {}
        for count, (i, result) in enumerate(zip(indices, pool.map(job, indices), strict=True)):
            results[i] = result
            done(count + 1)
        return results

    try:
        yield run
    finally:
        pool.shutdown(cancel_futures=True)
        torch.set_num_threads(threads)
