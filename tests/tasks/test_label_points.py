"""A checkpoint counts by its content: where it lies does not matter, what it holds does."""

from __future__ import annotations

import pytest

from garden_models.disentanglement.config import LabelPoints
from garden_models.scene import BadInput
from tasks.label_points import label_points
from tasks.step.inputs import Arguments


def key(config: LabelPoints) -> str:
    return label_points.key_parts(Arguments({}, {"config": config})).key


def test_the_key_follows_the_checkpoints_content(tmp_path):
    here, there, other = (tmp_path / name for name in ("here", "there", "other"))
    here.write_bytes(b"weights")
    there.write_bytes(b"weights")
    other.write_bytes(b"other weights")
    keys = [key(LabelPoints(method="network", weights=str(p))) for p in (here, there, other)]
    assert keys[0] == keys[1] != keys[2]


def test_the_rule_needs_no_checkpoint(tmp_path):
    assert key(LabelPoints()) == key(LabelPoints(method="geometric"))
    with pytest.raises(BadInput, match="no such checkpoint"):
        key(LabelPoints(method="network", weights=str(tmp_path / "none")))
