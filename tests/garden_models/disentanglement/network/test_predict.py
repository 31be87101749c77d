"""Labels that neither the order nor the chunks change; answers for any number of points."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.model import PointClassifier, near_attention
from garden_models.disentanglement.network.predict import choose_context, predict
from garden_models.disentanglement.training.pair import CONTEXT_POINTS, Condition
from garden_models.disentanglement.training.pairs import make_shard
from garden_models.disentanglement.training.pairs_config import PairsConfig
from garden_models.scene import BadInput

SMALL = NetworkConfig(width=32, token_layers=1, point_layers=1, scene_tokens=64, object_tokens=32)


@pytest.fixture(scope="module")
def cloud():
    """Return one crop with many points: the pool of a pair, jittered so that none is twice."""
    pair = make_shard("train", 7, 1, PairsConfig(augmented=0.0)).pair(1)
    rng = np.random.default_rng(0)
    points = np.tile(pair.cloud.points.astype(float), (10, 1))
    return points + rng.normal(0, 0.002 * pair.size, points.shape), pair.condition


@pytest.fixture(scope="module")
def model():
    """Return a network whose labels are not all alike: untrained, but steep and balanced."""
    torch.manual_seed(3)
    made = PointClassifier(SMALL)
    with torch.no_grad():
        made.head.weight.mul_(60)
        made.head.bias.zero_()
    return made.eval()


def test_labels_do_not_change_with_chunks_or_order(model, cloud):
    points, condition = cloud
    whole = predict(model, points, condition, chunk=len(points))
    balanced = np.median(whole)
    labels = whole >= balanced
    for chunk in (257, 4096):
        changed = (predict(model, points, condition, chunk) >= balanced) != labels
        assert changed.mean() < 1e-3
    order = np.random.default_rng(1).permutation(len(points))
    shuffled = predict(model, points[order], condition)
    assert ((shuffled >= balanced) != labels[order]).mean() < 1e-3
    np.testing.assert_allclose(shuffled, whole[order], atol=1e-4)


def test_what_is_said_of_a_point_does_not_depend_on_copies_asked_with_it(model, cloud):
    points, condition = cloud
    twice = predict(model, np.concatenate([points, points]), condition)
    np.testing.assert_allclose(twice[: len(points)], twice[len(points) :], atol=1e-6)


def test_the_context_is_spread_evenly_and_depends_on_the_set_alone(cloud):
    points, _ = cloud
    dense = np.concatenate([points, points[:5000] + 1e-5])
    chosen = choose_context(dense)
    assert len(chosen) == CONTEXT_POINTS
    order = np.random.default_rng(2).permutation(len(dense))
    again = choose_context(dense[order])
    np.testing.assert_array_equal(
        np.unique(dense[chosen], axis=0), np.unique(dense[order][again], axis=0)
    )
    # The first points are there twice; the context does not favour them.
    share = (chosen < 5000).mean() + (chosen >= len(points)).mean()
    assert share < 1.35 * 5000 / len(points) + 0.05


def test_few_points_are_answered_too(model, cloud):
    points, condition = cloud
    assert predict(model, points[:3], condition).shape == (3,)
    assert predict(model, points[:0], condition).shape == (0,)


def test_what_is_not_finite_is_refused(model, cloud):
    points, condition = cloud
    bad = points.copy()
    bad[5, 1] = np.nan
    with pytest.raises(BadInput, match="not finite"):
        predict(model, bad, condition)
    with pytest.raises(BadInput, match="mesh"):
        predict(
            model, points, Condition(condition.points * np.nan, condition.on, condition.triangles)
        )
    flat = Condition(np.zeros((10, 3)), np.zeros(10, int), np.zeros((10, 3, 3)))
    with pytest.raises(BadInput, match="extent"):
        predict(model, points, flat)


def test_near_attention_is_softmax_with_the_squared_distance():
    torch.manual_seed(0)
    query, key, value = (torch.randn(2, 4, n, 8) for n in (5, 7, 7))
    here, there = torch.randn(2, 5, 3), torch.randn(2, 7, 3)
    sharpness = torch.tensor([0.1, 1.0, 3.0, 10.0])
    distance = torch.cdist(here, there)[:, None] ** 2
    logits = query @ key.transpose(-1, -2) / 8**0.5 - sharpness[None, :, None, None] * distance
    expected = logits.softmax(dim=-1) @ value
    found = near_attention(query, key, value, here, there, sharpness)
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=1e-4)


def test_the_papers_inputs_are_coordinates_only(cloud):
    """Without geometric features nothing but the first three columns is read."""
    config = NetworkConfig(geometric=False, width=32, token_layers=1, point_layers=1)
    torch.manual_seed(0)
    model = PointClassifier(config)
    context, points = torch.randn(1, 40, 39), torch.randn(1, 9, 39)
    token, assigned = torch.arange(8)[None], torch.arange(40)[None] % 8
    condition = torch.randn(1, 16, 8)

    def answer(scale: float) -> torch.Tensor:
        factor = torch.cat([torch.ones(3), torch.full((36,), scale)])
        tokens, places = model.tokens(context * factor, token, assigned, condition)
        return model(points * factor, tokens, places)

    torch.testing.assert_close(answer(1.0), answer(-5.0))
