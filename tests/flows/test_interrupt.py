"""Ctrl-C loses nothing: what was finished is in the store, and a rerun goes on from there."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

FOREGROUND_GARDEN = """
import signal, sys
from flows.command import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main())
"""
"""A shell has its background jobs, and so perhaps these tests, ignore Ctrl-C."""

CORNER = Path(__file__).parents[1] / "scenes" / "corner"


@pytest.mark.slow
def test_ctrl_c_keeps_what_was_finished(tmp_path: Path) -> None:
    base = [sys.executable, "-c", FOREGROUND_GARDEN]
    shared = [str(CORNER), "--store", str(tmp_path / "store"), "--out", str(tmp_path / "scenes")]
    process = subprocess.Popen(
        [*base, "factorize", *shared, "--engine", "local"],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "ingest" in line and "executed" in line:
            break
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    said = process.stderr.read()
    assert process.wait(timeout=60) == 130, said
    assert "goes on from there" in said
    plan = subprocess.run(
        [*base, "plan", *shared, "--json"], capture_output=True, text=True, check=True,
        env=os.environ,
    )  # fmt: skip
    actions = {s["step"]: s["action"] for s in json.loads(plan.stdout)["steps"]}
    assert actions["ingest"] == "cached"
    assert actions["register"] == "would run"
