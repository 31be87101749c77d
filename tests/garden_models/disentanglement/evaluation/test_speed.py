"""Operations are counted as the layers do them; the plain form gives the same labels."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.nn.attention import SDPBackend, sdpa_kernel
from torch.utils.flop_counter import FlopCounterMode

from garden_models.disentanglement.evaluation.speed import dense_crop, measure, operations
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.describe import AROUND, OBJECT, OWN
from garden_models.disentanglement.network.model import PointClassifier

SMALL = NetworkConfig(width=32, token_layers=1, point_layers=2, scene_tokens=64, object_tokens=32)


def test_counted_operations_are_torchs_own_count():
    torch.manual_seed(0)
    model = PointClassifier(SMALL)
    features, condition = torch.randn(1, 900, OWN + AROUND), torch.randn(1, 32, OBJECT)
    token, assigned = torch.arange(64)[None], torch.arange(900)[None] % 64
    tokens, places = model.tokens(features, token, assigned, condition)
    # The counter does not know the fused kernel of the CPU.
    with sdpa_kernel(SDPBackend.MATH), FlopCounterMode(display=False) as counter:
        model(features, tokens, places)
    tokens_only = operations(model, 0)
    keys = sum(2 * b.key_value.in_features * b.key_value.out_features for b in model.point_blocks)
    counted = counter.get_total_flops() - 96 * keys
    assert operations(model, 900) - tokens_only == pytest.approx(counted, rel=1e-6)


@pytest.mark.slow
def test_the_plain_form_labels_alike():
    torch.manual_seed(0)
    speed = measure(PointClassifier(SMALL).eval(), points=20_000, threads=1)
    assert speed.most_label_changes < 1e-3
    assert speed.points == 20_000
    assert speed.gflops > 0


def test_the_crop_has_as_many_points_as_asked_for():
    points, condition = dense_crop(5000)
    assert points.shape == (5000, 3)
    assert np.isfinite(points).all()
    assert condition.size > 0
