"""Object-scene pairs: exact labels, area-weighted points, nothing that no photo could see."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.disentanglement.training.crop import (
    cut,
    expanded_box,
    is_target,
    turned,
)
from garden_models.disentanglement.training.pair import CONTEXT_POINTS
from garden_models.disentanglement.training.pairs import make_shard
from garden_models.disentanglement.training.pairs_config import CLEAN, CropConfig, PairsConfig
from garden_models.disentanglement.training.scenes.furnish import furnish
from garden_models.disentanglement.training.scenes.room import Instance, Room, Structure
from garden_models.disentanglement.training.shapes.families import make_shape
from garden_models.disentanglement.training.shapes.solid import block
from garden_models.disentanglement.triangles import closest_on_triangles, sample_triangles


@pytest.fixture(scope="module")
def room():
    return furnish("train", 2)


def targets(room):
    return [k for k in range(len(room.instances)) if is_target(room, k, CropConfig())]


def nearest(points, corners):
    """Return each point's distance to a soup of triangles."""
    return np.array(
        [
            np.linalg.norm(
                closest_on_triangles(np.tile(point, (len(corners), 1)), corners) - point, axis=1
            ).min()
            for point in points
        ]
    )


def test_positive_points_lie_on_the_instance_and_negative_ones_on_something_else(room):
    triangles = turned(room, 0.7)
    for index in targets(room)[:4]:
        cloud, condition = cut(triangles, index, np.random.default_rng(0), CropConfig())
        own = triangles.owner == index
        positive, negative = cloud.points[cloud.label], cloud.points[~cloud.label]
        assert nearest(positive[::300], triangles.corners[own]).max() < 1e-9
        assert nearest(negative[::300], triangles.corners[~own]).max() < 1e-9
        assert condition.points.shape == (2048, 3)
        assert nearest(condition.points[::100], triangles.corners[own]).max() < 1e-9


def test_the_crop_is_the_randomly_expanded_box(room):
    index = targets(room)[0]
    triangles = turned(room, 0.0)
    own = triangles.corners[triangles.owner == index]
    config = CropConfig()
    low, high = expanded_box(own, np.random.default_rng(1), config)
    size = np.ptp(own, axis=(0, 1)).max()
    for margin, (least, most) in (
        ((own.min(axis=(0, 1)) - low)[[0, 2]], config.sideways),
        ((own.min(axis=(0, 1)) - low)[1], config.above),
        ((high - own.max(axis=(0, 1)))[1], config.below),
    ):
        assert (np.atleast_1d(margin) >= least * size - 1e-12).all()
        assert (np.atleast_1d(margin) <= most * size + 1e-12).all()
    cloud, _ = cut(triangles, index, np.random.default_rng(1), config)
    assert (cloud.points >= low).all()
    assert (cloud.points <= high).all()


def test_points_are_drawn_in_proportion_to_area():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[5.0, 0, 0], [8, 0, 0], [5, 1, 0]]])
    points, which = sample_triangles(corners, 40_000, np.random.default_rng(0))
    assert (which == 1).mean() == pytest.approx(0.75, abs=0.01)
    np.testing.assert_allclose(points[which == 0].mean(axis=0), [1 / 3, 1 / 3, 0], atol=0.01)


def test_where_a_base_presses_on_its_support_no_point_is_left():
    cube, floor = make_shape("carton", 1), block((-2, 0, -2), (2, 0.1, 2))
    room = Room(
        "one",
        (Instance(cube, (0.0, 0.0, 0.0), 0.0),),
        (Structure("floor", floor.vertices, floor.faces),),
    )
    cloud, _ = cut(turned(room, 0.0), 0, np.random.default_rng(0), CropConfig())
    x, _, z = cube.extent / 2
    under = (np.abs(cloud.points[:, 0]) < x) & (np.abs(cloud.points[:, 2]) < z)
    at_base = np.abs(cloud.points[:, 1]) < 1e-6
    assert not (under & at_base).any()
    assert (at_base & ~cloud.label).sum() > 500


def test_flat_tiny_and_huge_things_are_no_targets(room):
    config = CropConfig()
    for k, instance in enumerate(room.instances):
        if instance.shape.family == "cutlery":
            assert is_target(room, k, config) == (instance.shape.extent.min() >= 0.008)
    assert not is_target(room, 0, CropConfig(most_size=0.1))


def test_a_shard_is_a_function_of_its_numbers():
    one, again = (make_shard("test", 3, 1, CLEAN) for _ in range(2))
    np.testing.assert_array_equal(one.points, again.points)
    np.testing.assert_array_equal(one.triangles, again.triangles)
    assert one.points.shape[1] == PairsConfig().points > CONTEXT_POINTS
    assert 0.03 < one.label.mean() < 0.8
    assert all(scene == "test/3" for scene in one.scenes)
    other = make_shard("test", 4, 1, CLEAN)
    assert set(one.shapes) != set(other.shapes)


def test_augmented_pairs_show_the_same_crops_as_clean_ones():
    clean, augmented = make_shard("train", 6, 1, CLEAN), make_shard("train", 6, 1, PairsConfig())
    assert set(augmented.shapes) <= set(clean.shapes)
    for k, shape in enumerate(augmented.shapes):
        same = [j for j, name in enumerate(clean.shapes) if name == shape]
        sizes = clean.size[same]
        assert np.isclose(sizes, augmented.size[k], rtol=1e-5).any()
