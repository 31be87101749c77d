"""What the test models do instead of answering, by ``Question.how``."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from garden_models.scene import BadInput
from tests.tasks.model.nouns import Answer, Part, Question

SLOW_S = 8.0


def _die(_question: Question) -> None:
    print("the driver gave up")
    sys.stdout.flush()
    os.kill(os.getpid(), signal.SIGKILL)


def _leave(_question: Question) -> None:
    print("no more", file=sys.stderr)
    sys.stderr.flush()
    os._exit(7)


def _hang(_question: Question) -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    print("child", child.pid, flush=True)
    time.sleep(600)


def _slow(question: Question) -> Answer:
    time.sleep(SLOW_S)
    return Answer(question.values, 0.0)


def _hoard(_question: Question) -> None:
    kept = [np.ones(25_000_000) for _ in range(20)]
    time.sleep(600)
    kept.clear()


def _refuse(_question: Question) -> None:
    raise BadInput("the question is bad: ask another one")


def _fill(_question: Question) -> None:
    raise MemoryError("no room for 3 more bytes")


def _fill_gpu(_question: Question) -> None:
    raise type("OutOfMemoryError", (RuntimeError,), {})("CUDA out of memory\nand a long tale")


def _raise(_question: Question) -> None:
    raise ZeroDivisionError(f"by nothing, {os.environ.get('HIDDEN_TOKEN', 'and no secret here')}")


def _wrong_type(_question: Question) -> Any:
    return Part(np.eye(4))


def _no_noun(_question: Question) -> Any:
    return {"values": 3}


def _unwritable(question: Question) -> Any:
    return Answer(question.values, object(), ())  # type: ignore[arg-type]


def _nan(question: Question) -> Answer:
    pose = np.eye(4)
    pose[0, 3] = np.nan
    return Answer(question.values, 0.0, (Part(np.eye(4)), Part(pose)))


def _infinite(question: Question) -> Answer:
    return Answer(question.values, float("inf"))


def _wrong_shape(question: Question) -> Answer:
    return Answer(question.values.T.copy(), 0.0)


def _too_few(question: Question) -> Answer:
    return Answer(question.values[1:], 0.0)


def _wrong_dtype(question: Question) -> Answer:
    return Answer(question.values.astype(np.int64), 0.0)


def _objects(_question: Question) -> Answer:
    return Answer(np.array([[object(), None]], dtype=object), 0.0)


def _say_secret(question: Question) -> Answer:
    print("I was started with", sorted(name for name in os.environ if "TOKEN" in name))
    print("and somebody told me hunter2-hunter2")
    return Answer(question.values, 0.0)


def _pid(question: Question) -> Answer:
    return Answer(question.values, float(os.getpid()))


HOW: dict[str, Callable[[Question], Any]] = {
    "die": _die,
    "leave": _leave,
    "hang": _hang,
    "slow": _slow,
    "hoard": _hoard,
    "bad": _refuse,
    "memory": _fill,
    "gpu memory": _fill_gpu,
    "bug": _raise,
    "wrong type": _wrong_type,
    "no noun": _no_noun,
    "unwritable": _unwritable,
    "nan": _nan,
    "infinite": _infinite,
    "wrong shape": _wrong_shape,
    "too few": _too_few,
    "wrong dtype": _wrong_dtype,
    "objects": _objects,
    "say secret": _say_secret,
    "pid": _pid,
}
