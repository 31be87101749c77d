"""The network labels a reconstruction as the rule does: crop, probabilities, put back."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from garden_models.disentanglement.config import LabelPoints
from garden_models.disentanglement.label import label_points
from garden_models.disentanglement.network.checkpoint import to_bytes
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.scene import BadInput
from tests.garden_models.disentanglement.table_top import table_top

SMALL = NetworkConfig(width=32, token_layers=1, point_layers=1, scene_tokens=64, object_tokens=32)


@pytest.fixture
def weights(tmp_path):
    torch.manual_seed(0)
    path = tmp_path / "a.safetensors"
    path.write_bytes(to_bytes(PointClassifier(SMALL), {}))
    return path


def labels(scene, config):
    return label_points(
        scene.reconstruction, scene.gravity_view, scene.masks, scene.mesh, scene.placement, config
    )


def test_every_point_of_the_scene_gets_a_probability(weights):
    scene = table_top()
    got = labels(scene, LabelPoints(method="network", weights=str(weights)))
    assert got.method == "network"
    assert got.probability.shape == (len(scene.reconstruction.points_world),)
    assert ((got.probability >= 0) & (got.probability <= 1)).all()
    assert 0 < (got.probability == 0).mean() < 1  # outside of the crop
    again = labels(scene, LabelPoints(method="network", weights=str(weights)))
    np.testing.assert_array_equal(got.probability, again.probability)


def test_a_missing_checkpoint_is_told(tmp_path):
    with pytest.raises(BadInput, match="No such file"):
        labels(table_top(), LabelPoints(method="network", weights=str(tmp_path / "none")))
