"""What the network reads: exact distances, features that turn with the scene."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.disentanglement.network.condition_distance import to_condition
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.describe import (
    AROUND,
    OBJECT,
    OWN,
    describe_context,
    describe_points,
    farthest_points,
)
from garden_models.disentanglement.network.surroundings import (
    cluster_features,
    clusters,
    local_shape,
    neighbours,
)
from garden_models.disentanglement.training.pair import CONTEXT_POINTS, Condition
from garden_models.disentanglement.training.pairs import make_shard
from garden_models.disentanglement.training.pairs_config import CLEAN
from garden_models.disentanglement.training.symmetry import symmetry
from garden_models.disentanglement.triangles import closest_on_triangles, sample_triangles

CONFIG = NetworkConfig()


@pytest.fixture(scope="module")
def pair():
    shard = make_shard("train", 3, 1, CLEAN)
    return shard.pair(0)


def test_the_closest_point_of_a_triangle_is_as_near_as_any_sample_of_it():
    rng = np.random.default_rng(0)
    triangles = rng.normal(0, 1, (300, 3, 3))
    points = rng.normal(0, 1.5, (300, 3))
    found = closest_on_triangles(points, triangles)
    distance = np.linalg.norm(found - points, axis=1)
    for k in range(300):
        samples, _ = sample_triangles(triangles[k : k + 1], 3000, rng)
        nearest = np.linalg.norm(samples - points[k], axis=1).min()
        assert distance[k] <= nearest + 1e-9
        assert nearest - distance[k] < 0.1


def test_distance_is_zero_on_the_surface_and_has_a_side():
    a = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points, on = sample_triangles(a[None], 50, np.random.default_rng(0))
    lying = to_condition(
        np.array([[0.2, 0.2, 0.0], [0.2, 0.2, 0.3], [0.2, 0.2, -0.3], [-1.0, 0, 0]]),
        Condition(points, on, a[None]),
    )
    np.testing.assert_allclose(lying.distance, [0, 0.3, 0.3, 1.0], atol=1e-12)
    side = (lying.towards * lying.normal).sum(axis=1)
    np.testing.assert_allclose(side[1:3], [1, -1], atol=1e-9)


def test_clean_object_points_lie_on_the_condition_and_others_do_not(pair):
    distance = to_condition(pair.cloud.points.astype(float), pair.condition).distance
    on_it = distance < 1e-3 * pair.condition.size
    assert on_it[pair.cloud.label].mean() > 0.95
    assert on_it[~pair.cloud.label].mean() < 0.05


def assert_alike(one, other):
    """Compare features; near an edge either face's normal is right."""
    same = np.isclose(one, other, atol=2e-3)[one[:, 3] > 0.01]
    of_normal = [5, 9, 10, 11, 14, OWN + 3]
    assert np.delete(same, of_normal, axis=1).all(axis=1).mean() > 0.97
    assert same[:, of_normal].all(axis=1).mean() > 0.5


def test_features_do_not_depend_on_place_or_size_unit_free(pair):
    """Moving the scene changes nothing; the size enters once, as its logarithm."""
    points = pair.cloud.points.astype(float)
    given = pair.condition
    there = Condition(given.points + 5.0, given.on, given.triangles + 5.0)
    one = describe_context(points[:CONTEXT_POINTS], given, CONFIG)
    moved = describe_context(points[:CONTEXT_POINTS] + 5.0, there, CONFIG)
    assert_alike(one.features, moved.features)
    twice = Condition(2 * given.points, given.on, 2 * given.triangles)
    scaled = describe_context(2 * points[:CONTEXT_POINTS], twice, CONFIG)
    differ = np.median(np.abs(scaled.features - one.features), axis=0) > 1e-3
    assert np.flatnonzero(differ).tolist() == [13]


def test_shapes_of_what_is_read(pair):
    points = pair.cloud.points.astype(float)
    context = describe_context(points[:CONTEXT_POINTS], pair.condition, CONFIG)
    assert context.features.shape == (CONTEXT_POINTS, OWN + AROUND)
    assert context.condition.shape == (CONFIG.object_tokens, OBJECT)
    assert len(set(context.token)) == CONFIG.scene_tokens
    assert context.assigned.max() == CONFIG.scene_tokens - 1
    asked = describe_points(points[:50], context)
    np.testing.assert_allclose(asked, context.features[:50], atol=1e-5)


def test_quarter_turns_and_mirrors_of_features_are_those_of_the_scene(pair):
    points = pair.cloud.points[:CONTEXT_POINTS].astype(float)
    one = describe_context(points, pair.condition, CONFIG)
    for number in range(8):
        swap = np.eye(3)[[2, 1, 0]] if number & 1 else np.eye(3)
        flip = np.diag([-1.0 if number & 2 else 1, 1, -1.0 if number & 4 else 1])
        turn = swap @ flip
        # A mirror reverses the order of a triangle's corners.
        order = [0, 1, 2] if np.linalg.det(turn) > 0 else [0, 2, 1]
        condition = Condition(
            pair.condition.points @ turn.T,
            pair.condition.on,
            (pair.condition.triangles @ turn.T)[:, order],
        )
        expected = describe_context(points @ turn.T, condition, CONFIG)
        features, tokens = symmetry(one.features, one.condition, number)
        assert_alike(features, expected.features)
        np.testing.assert_allclose(tokens, expected.condition, atol=2e-3)


def test_farthest_points_cover_what_they_are_chosen_from():
    points = np.random.default_rng(0).uniform(0, 1, (3000, 3))
    chosen = points[farthest_points(points, 64)]
    gaps = np.linalg.norm(chosen[:, None] - chosen[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    assert gaps.min() > 0.15
    assert len(farthest_points(points[:10], 64)) == 10


def test_a_plane_is_flat_and_a_line_is_thin():
    rng = np.random.default_rng(0)
    plane = np.column_stack([rng.uniform(0, 1, (500, 2)), np.zeros(500)])
    line = np.column_stack([np.linspace(5, 6, 200), np.zeros((200, 2))])
    points = np.concatenate([plane, line])
    shape = local_shape(points, neighbours(points))
    assert np.median(np.abs(shape.normal[:500, 2])) > 0.999
    assert shape.flatness[:500, 0].max() < 1e-6
    assert np.median(shape.flatness[:500, 1]) > 0.6
    assert shape.flatness[500:].max() < 1e-3


def test_clusters_are_what_hangs_together():
    rng = np.random.default_rng(0)
    two = np.concatenate([rng.uniform(0, 0.1, (200, 3)), rng.uniform(1, 1.1, (100, 3))])
    left_out = np.zeros(300, bool)
    left_out[:20] = True
    label = clusters(two, left_out, 0.1)
    assert (label[:20] == -1).all()
    assert len(set(label[20:200])) == len(set(label[200:])) == 1
    assert label[20] != label[200]
    near = np.arange(300) < 110
    features = cluster_features(two, label, near)
    assert (features[:20] == 0).all()
    np.testing.assert_allclose(features[50, :3], [180 / 300, 90 / 180, 90 / 110])
    np.testing.assert_allclose(features[250, 3:6], 1.05, atol=0.01)
