"""Collect what MuJoCo warns of; it would write that to MUJOCO_LOG.TXT in the current folder.

MuJoCo has one warning handler a process, and calls it on the thread that it warns of. While
anything collects, the handler is ours: it gives a warning to all who collect on its thread,
and what other threads are warned of to the handler before, or to the log.
"""

from __future__ import annotations

import logging
import re
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mujoco

TIME = re.compile(r"\s*Time = [\d.]+")
"""Tells a warning from the same one a step later."""
NUMBER = re.compile(r"[\d.]+")


class Collected:
    """The warnings so far, those that differ in numbers only counted as one."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._counts: Counter[str] = Counter()

    def add(self, warning: str) -> None:
        """Count a warning."""
        text = TIME.sub("", warning).strip()
        kind = NUMBER.sub("#", text)
        self._texts.setdefault(kind, text)
        self._counts[kind] += 1

    @property
    def reasons(self) -> tuple[str, ...]:
        """A sentence for each kind, in the order of their first appearance."""
        return tuple(
            f"MuJoCo warned {'once' if n == 1 else f'{n} times'}: {self._texts[kind]}"
            for kind, n in self._counts.items()
        )


class _OnThisThread(threading.local):
    def __init__(self) -> None:
        self.collectors: list[Collected] = []


_here = _OnThisThread()
_lock = threading.Lock()
_open = 0
_before: Callable[[str], None] | None = None


@contextmanager
def collect_warnings() -> Iterator[Collected]:
    """Collect MuJoCo's warnings on this thread; nothing is written to any file meanwhile.

    Collectors may be nested (each gets them all), and may be open on many threads.
    """
    global _open, _before  # noqa: PLW0603
    collected = Collected()
    with _lock:
        if _open == 0:
            _before = mujoco.get_mju_user_warning()
            mujoco.set_mju_user_warning(_hand_out)
        _open += 1
    _here.collectors.append(collected)
    try:
        yield collected
    finally:
        _here.collectors.remove(collected)
        with _lock:
            _open -= 1
            if _open == 0:
                mujoco.set_mju_user_warning(_before)


def _hand_out(warning: str) -> None:
    """Give a warning to whom it concerns; an exception here would abort the process."""
    for collected in _here.collectors:
        collected.add(warning)
    if not _here.collectors:
        (_before or logging.getLogger("mujoco").warning)(warning)
