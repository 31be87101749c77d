"""Memory is read from /proc, where processes come, go and are called anything."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tasks.step.memory import process_rss, session_rss

SLEEPER = """
import ctypes, sys
ctypes.CDLL(None).prctl(15, b"\\xff\\xfe) x", 0, 0, 0)
print("named", flush=True)
sys.stdin.read()
"""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/proc is Linux'")


@pytest.fixture
def oddly_named() -> Iterator[int]:
    """A process in a session of its own whose name is no text."""
    process = subprocess.Popen(
        [sys.executable, "-c", SLEEPER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"named\n"
    yield process.pid
    process.communicate()


def test_a_process_whose_name_is_no_text_is_counted_in_its_session(oddly_named: int) -> None:
    assert session_rss(oddly_named) == pytest.approx(process_rss(oddly_named), rel=0.2)
    assert session_rss(oddly_named) > 1e6


def test_it_does_not_disturb_the_reading_of_other_sessions(oddly_named: int) -> None:
    assert session_rss(os.getsid(0)) > 0


def test_a_process_that_is_gone_takes_no_memory() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    assert process_rss(gone.pid) == 0
    assert session_rss(gone.pid) == 0
