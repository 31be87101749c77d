"""Workers and keepers are killed at random while many ask: answers are right, or a model failed."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from garden_models.foundation.failure import ModelFailed
from tasks.model import predictor
from tasks.model.exchange import exchange_root
from tasks.model.keeper_process import model_keeper
from tests.tasks.model.nouns import Question

ASKERS, QUESTIONS, KILLS = 4, 25, 8
FACTORS = {"doubler": 2.0, "tripler": 3.0}


def children(pid: int) -> list[int]:
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError, IndexError):
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if entry.name.isdigit() and parent == pid:
                found.append(int(entry.name))
    return found


def keepers() -> list[int]:
    words = b"tasks.model.keeper"
    return [p for p in children(os.getpid()) if words in Path(f"/proc/{p}/cmdline").read_bytes()]


def kill_at_random(generator: random.Random, stop: threading.Event) -> int:
    """Kill a worker, and each fourth time the keeper; return how many were killed."""
    killed = 0
    while killed < KILLS and not stop.wait(generator.uniform(0.2, 1.2)):
        victims = keepers()
        if killed % 4 != 3:
            victims = [child for keeper in victims for child in children(keeper)]
        for victim in victims[:1]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(victim, signal.SIGKILL)
                killed += 1
    return killed


def ask_many(seed: int) -> tuple[int, int]:
    """Return how many questions were answered, all of them right, and how many failed."""
    generator, answered, failed = random.Random(seed), 0, 0
    while answered < QUESTIONS:
        name = generator.choice(sorted(FACTORS))
        values = np.full((generator.randrange(1, 50), 2), generator.random())
        try:
            with predictor(name) as predict:
                answer = predict(Question(values))
        except ModelFailed:
            failed += 1
            assert failed < 200
            continue
        assert np.array_equal(answer.values, values * FACTORS[name])
        answered += 1
        time.sleep(generator.uniform(0, 0.1))
    return answered, failed


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_every_answer_is_right_whoever_is_killed(models: Path, seed: int) -> None:
    stop = threading.Event()
    with model_keeper() as costs, ThreadPoolExecutor(ASKERS + 1) as pool:
        killing = pool.submit(kill_at_random, random.Random(seed), stop)
        asking = [pool.submit(ask_many, ASKERS * seed + number) for number in range(ASKERS)]
        told = [future.result(timeout=400) for future in asking]
        stop.set()
        assert killing.result(timeout=60) > 0
        with predictor("doubler") as predict:
            assert predict(Question(np.ones((1, 2)))).values[0, 0] == 2.0
        assert sum(cost["loads"] for cost in costs().values()) > 0
    assert [answered for answered, _ in told] == [QUESTIONS] * ASKERS
    assert keepers() == []
    assert list(exchange_root().glob(f"{os.getpid()}-*")) == []
