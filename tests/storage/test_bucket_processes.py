"""Processes that share only a bucket: of racing creators one wins, the killed leave no half."""

from __future__ import annotations

import random
import subprocess
import sys
import time

import pytest

from storage import Store
from tests.s3_server import HERE, S3Server
from tests.storage.samples import Scene
from tests.storage.test_bucket import IN_A_BUCKET

pytestmark = pytest.mark.slow


def begin(work: str, store: Store, name: str) -> subprocess.Popen[str]:
    """Start a worker and wait until it is ready to begin."""
    worker = subprocess.Popen(
        [sys.executable, "-m", "tests.storage.bucket_worker", work, store.address, name],
        cwd=HERE,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert worker.stdout is not None
    assert worker.stdout.readline() == "ready\n"
    return worker


def wait_for_requests(s3: S3Server, count: int) -> None:
    """Wait until the server was asked so many times from now on."""
    s3.counted()
    deadline = time.monotonic() + 60
    while count > 0:
        assert time.monotonic() < deadline
        time.sleep(0.01)
        count -= len(s3.counted())


def go(worker: subprocess.Popen[str]) -> None:
    assert worker.stdin is not None
    worker.stdin.write("\n")
    worker.stdin.flush()


@IN_A_BUCKET
def test_of_sixteen_creators_in_four_processes_exactly_one_wins(store: Store) -> None:
    workers = [begin("create", store, name) for name in "abcd"]
    won: list[str] = []
    try:
        for worker in workers:
            go(worker)
        for worker in workers:
            assert worker.stdout is not None
            while (line := worker.stdout.readline().strip()) != "done":
                assert line
                won.append(line)
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()
    documents = [line.split()[1] for line in won if line.startswith("document")]
    assert len(documents) == 1
    assert store.medium.read("pins/raced") == documents[0].encode()
    assert len([line for line in won if line.startswith("lease")]) == 1


@IN_A_BUCKET
def test_sealed_and_no_dangling_whenever_writers_are_killed(store: Store, s3: S3Server) -> None:
    seed = 7
    moments = random.Random(seed)
    for trial in range(10):
        workers = [begin("publish", store, f"w{trial}-{n}") for n in range(2)]
        for worker in workers:
            go(worker)
        for worker in workers:
            wait_for_requests(s3, moments.randint(1, 80))
            worker.kill()
            worker.wait()
        assert store.verify("full") == [], f"trial {trial} of seed {seed}"
        for record in store.actions():
            assert store.lookup(record.key)[1] == "hit"
            store.read(record.outputs["value"].object, Scene)
    assert len(list(store.actions())) > 3  # the moments are not all before the first
    before = {digest for digest, _size in store.objects()}
    s3.age(hours=25)
    store.medium.sweep()
    assert {digest for digest, _size in store.objects()} == before
    assert store.verify("full") == []
