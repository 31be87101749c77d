"""A batch that is killed whole goes on where it was (``make faults`` does this at length)."""

from __future__ import annotations

from pathlib import Path

from tests.faults.batch_kills import Setting, kill_a_batch


def test_same_as_cold_a_killed_batch_repeats_nothing_and_ends_as_if_undisturbed(
    tmp_path: Path,
) -> None:
    paths = {name: str(tmp_path / name) for name in ("store", "out", "trace")}
    setting = Setting(**paths, scenes="simulated", engine="local", count=6)
    for count in kill_a_batch(tmp_path, setting, kills=3, seed=0):
        assert count.violations == ()
        assert count.trials > 0
