"""A training that is killed goes on from its last checkpoint and ends with the same weights."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from flows.training.record import CHECKPOINT, PAGE, RECORD
from garden_models.disentanglement.network.checkpoint import load_checkpoint
from garden_models.training.weights_file import weights_digest

ROOT = Path(__file__).parents[3]


def start(store: Path, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.flows.training.tiny_training", str(store), str(out)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def finish(process: subprocess.Popen[str]) -> list[str]:
    said, _ = process.communicate(timeout=600)
    assert process.returncode == 0
    return said.splitlines()


@pytest.mark.slow
def test_a_killed_training_ends_with_the_same_weights(tmp_path):
    killed = start(tmp_path / "killed", tmp_path / "a")
    assert killed.stdout is not None
    for line in killed.stdout:
        if line.startswith("train_point_classifier to step 2"):
            killed.kill()  # SIGKILL: nothing is cleaned up
            break
    killed.wait(timeout=60)
    assert not (tmp_path / "a" / CHECKPOINT).exists()
    again = finish(start(tmp_path / "killed", tmp_path / "a"))
    undisturbed = finish(start(tmp_path / "whole", tmp_path / "b"))
    assert "train_point_classifier to step 2 cached" in again
    assert "train_point_classifier to step 2 executed" in undisturbed
    assert "train_point_classifier to step 6 executed" in again
    one, other = ((tmp_path / name / CHECKPOINT).read_bytes() for name in "ab")
    assert one == other
    check_record(tmp_path / "b", other)


def check_record(folder: Path, checkpoint: bytes) -> None:
    """The record says what went in and what came out."""
    record = json.loads((folder / RECORD).read_text())
    assert record["checkpoint"]["digest"] == weights_digest(checkpoint)
    assert record["steps"] == 6
    assert record["seed"] == 0
    assert record["preset"]["network"]["width"] == 16
    assert all(record["data"].values())
    assert record["hours"]["total"] >= 0
    assert record["hardware"]["torch"]
    assert set(record["scores"]) == {"clean", "augmented", "full strength"}
    for scores in record["scores"].values():
        methods = [score["method"] for score in scores["scores"]]
        assert methods == ["network", "box crop", "distance to mesh", "connected components"]
        for score in scores["scores"]:
            assert {"F1", "IoU", "accuracy", "precision", "recall"} <= set(score["row"])
    read = load_checkpoint(folder / CHECKPOINT, record["checkpoint"]["digest"])
    assert read.record["steps"] == 6
    html = (folder / PAGE).read_text()
    assert "<svg" in html
    assert html.count("<img") > 6
    assert "http" not in html.replace("http://www.w3.org", "")
