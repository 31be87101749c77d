"""A training that is killed goes on from its last checkpoint and ends with the same weights."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import dataclasses, sys
from pathlib import Path
from flows.training.gravity import checkpoint_bytes, train
from flows.training.run import run_training
from garden_models.gravity.training.config import SMOKE, embedded_network
from storage import Store

optimisation = dataclasses.replace(
    SMOKE.optimisation, steps=9, tokens_a_batch=16, warm_up=2, threads=1
)
preset = dataclasses.replace(
    SMOKE, name="tiny", scenes=8, validation_scenes=10, scenes_a_shard=10, checkpoint_every=3,
    network=embedded_network(16, 1, 2, 16, 16), optimisation=optimisation,
)

def tell(event):
    print(event.step, event.label, event.kind, event.outcome, flush=True)

body = lambda: checkpoint_bytes(train(preset))
data = run_training("tiny", Store.open(sys.argv[1]), tell, "local", body)
Path(sys.argv[2]).write_bytes(data)
"""

KILLED_AT = "train_gravity_decoder to step 6 progress"


def run(store: Path, out: Path, stop_at: str = "") -> list[str]:
    """Train in a process of its own; with ``stop_at`` kill it when a line starts so."""
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(store), str(out)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    lines = []
    assert process.stdout is not None
    for line in process.stdout:
        lines.append(line.strip())
        if stop_at and line.startswith(stop_at):
            os.killpg(process.pid, signal.SIGKILL)
            break
    code = process.wait()
    assert code == (-signal.SIGKILL if stop_at else 0)
    return lines


@pytest.mark.slow
def test_a_killed_training_ends_with_the_weights_of_an_undisturbed_one(tmp_path):
    run(tmp_path / "calm", tmp_path / "calm.safetensors")
    run(tmp_path / "killed", tmp_path / "killed.safetensors", KILLED_AT)
    assert not (tmp_path / "killed.safetensors").exists()
    again = run(tmp_path / "killed", tmp_path / "killed.safetensors")
    assert "train_gravity_decoder to step 3 finished cached" in again
    assert "train_gravity_decoder to step 9 finished executed" in again
    calm, killed = (tmp_path / f"{name}.safetensors" for name in ("calm", "killed"))
    assert killed.read_bytes() == calm.read_bytes()
