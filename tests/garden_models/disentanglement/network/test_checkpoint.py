"""Checkpoints: the same bytes for the same weights, refused when they do not fit."""

from __future__ import annotations

import json

import numpy as np
import pytest
import safetensors.torch
import torch

from garden_models.disentanglement.network.checkpoint import (
    from_bytes,
    load_checkpoint,
    to_bytes,
)
from garden_models.disentanglement.network.classify import classify, condition_of, load
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.network.shipped import DIGEST, checkpoint_file
from garden_models.disentanglement.protocol import Crop, PlacedMesh, classifier
from garden_models.scene import BadInput, PointCloud
from garden_models.training.weights_file import weights_digest

SMALL = NetworkConfig(width=32, token_layers=1, point_layers=1, scene_tokens=64, object_tokens=32)


def model() -> PointClassifier:
    torch.manual_seed(0)
    return PointClassifier(SMALL)


def changed(data: bytes, **values) -> bytes:
    """Return a checkpoint whose description differs."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    description = json.loads(header["__metadata__"]["garden"]) | values
    weights = safetensors.torch.load(data)
    return safetensors.torch.save(weights, {"garden": json.dumps(description)})


def crop(points: np.ndarray, size: float = 0.2) -> Crop:
    corners = size * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    n = len(points)
    cloud = PointCloud(
        points, np.zeros((n, 3), np.uint8), np.zeros((n, 3)), np.full(n, 0.01), np.ones(n)
    )
    return Crop(cloud, PlacedMesh(corners, faces), (), None)


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    made = model()
    data = to_bytes(made, {"preset": "smoke"})
    assert data == to_bytes(made, {"preset": "smoke"})
    path = tmp_path / "a.safetensors"
    path.write_bytes(data)
    read = load_checkpoint(path, weights_digest(data))
    assert read.record == {"preset": "smoke"}
    assert read.model.config == SMALL
    for name, weight in made.state_dict().items():
        assert torch.equal(read.model.state_dict()[name], weight)


def test_another_content_than_asked_for_is_refused(tmp_path):
    path = tmp_path / "a.safetensors"
    path.write_bytes(to_bytes(model(), {}))
    with pytest.raises(BadInput, match="digest"):
        load_checkpoint(path, "0" * 64)
    with pytest.raises(BadInput, match="No such file"):
        load_checkpoint(tmp_path / "none.safetensors")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"version": 99}, "version is 99"),
        ({"unit": "inch"}, "unit is 'inch'"),
        ({"inputs": {"own": 3, "around": 0, "object": 3}}, "inputs"),
        ({"kind": "gravity-decoder"}, "kind"),
        ({"network": {"width": 64}}, "do not fit"),
        ({"network": {"wings": 2}}, "do not fit"),
    ],
)
def test_a_checkpoint_of_something_else_is_refused(values, said):
    with pytest.raises(BadInput, match=said):
        from_bytes(changed(to_bytes(model(), {}), **values))


def test_garbage_is_refused():
    for data in (b"", b"12345678", b"\x10\0\0\0\0\0\0\0{}", np.random.bytes(4000)):
        with pytest.raises(BadInput, match="no checkpoint"):
            from_bytes(data)


def test_weights_that_are_not_finite_are_refused():
    made = model()
    with torch.no_grad():
        made.head.weight[0, 3] = torch.nan
    with pytest.raises(BadInput, match=r"head\.weight"):
        from_bytes(to_bytes(made, {}))


def test_a_crop_is_labelled_by_a_given_checkpoint(tmp_path):
    path = tmp_path / "a.safetensors"
    path.write_bytes(to_bytes(model(), {}))
    points = np.random.default_rng(0).uniform(-0.1, 0.3, (500, 3))
    probability = classifier("network", str(path))(crop(points), lambda *_: None)
    assert probability.shape == (500,)
    assert ((probability > 0) & (probability < 1)).all()


def test_sizes_that_cannot_be_metres_are_refused(tmp_path):
    path = tmp_path / "a.safetensors"
    path.write_bytes(to_bytes(model(), {}))
    points = np.random.default_rng(0).uniform(-100, 300, (500, 3))
    with pytest.raises(BadInput, match="metres"):
        classify(crop(points, 200.0), weights=str(path))
    with pytest.raises(BadInput, match="no surface"):
        condition_of(PlacedMesh(np.zeros((3, 3)), np.zeros((0, 3), int)))


def test_the_rule_takes_no_weights():
    with pytest.raises(BadInput, match="takes no weights"):
        classifier("geometric", "some.safetensors")


def test_the_shipped_checkpoint_is_what_its_digest_says():
    if checkpoint_file() is None:
        with pytest.raises(BadInput, match="garden train point-classifier"):
            load()
        return
    shipped = load()
    assert shipped.digest == DIGEST
    assert checkpoint_file().stat().st_size < 20e6
