"""The random trials of ``python -m tests.faults``, a seeded few of them."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from tests.faults.__main__ import report
from tests.faults.forks import in_own_process
from tests.faults.part import PARTS, Count


def violations(module: str, folder: Path, trials: int) -> list[str]:
    counts = in_own_process(module, str(folder), str(trials))
    assert all(count.trials >= 1 for count in counts)
    return [violation for count in counts for violation in count.violations]


def test_no_dangling_orphans_only_when_writers_and_a_collector_are_killed(tmp_path: Path) -> None:
    assert violations("soak", tmp_path, 20) == []


def test_locks_die_with_owners_two_workers_one_key(tmp_path: Path) -> None:
    assert violations("single_flight", tmp_path, 1) == []


def test_the_table_says_what_was_violated(capsys: pytest.CaptureFixture[str]) -> None:
    good = Count("kill at rename", 3)
    assert report({"publish": [good]}) == 0
    assert "VIOLATED" not in capsys.readouterr().out
    assert report({"publish": [good, Count("kill at link", 2, ("k1 is evicted",))]}) == 1
    out = capsys.readouterr().out
    assert "VIOLATED" in out
    assert "k1 is evicted" in out


def test_a_part_that_tries_nothing_is_a_violation() -> None:
    assert report({"empty": []}) == 1


def test_a_module_that_breaks_is_a_violation() -> None:
    [count] = in_own_process("nowhere")
    assert "nowhere" in count.violations[0]


def test_what_is_here_is_registered() -> None:
    for name in ("soak", "single_flight"):
        importlib.import_module(f"tests.faults.{name}")
    assert {"soak", "single flight"} <= PARTS.keys()
