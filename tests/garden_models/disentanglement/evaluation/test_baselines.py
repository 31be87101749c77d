"""Baselines on a scene whose right answer is plain, and scores by range."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.disentanglement.evaluation.baselines import (
    GRIDS,
    BoxCrop,
    Connected,
    NearMesh,
    chosen,
    pooled,
)
from garden_models.disentanglement.evaluation.score import score
from garden_models.disentanglement.training.crop import cut, turned
from garden_models.disentanglement.training.pair import Condition, Pair
from garden_models.disentanglement.training.pairs_config import CropConfig
from garden_models.disentanglement.training.scenes.room import Instance, Room, Structure
from garden_models.disentanglement.training.shapes.families import make_shape
from garden_models.disentanglement.training.shapes.solid import block


def pair(shift: float = 0.0) -> Pair:
    """Return a carton alone on a floor; its mesh is shifted sideways by a share of its size."""
    shape, floor = make_shape("carton", 1), block((-2, 0, -2), (2, 0.1, 2))
    room = Room(
        "one",
        (Instance(shape, (0.0, 0.0, 0.0), 0.0),),
        (Structure("floor", floor.vertices, floor.faces),),
    )
    cloud, condition = cut(turned(room, 0.0), 0, np.random.default_rng(0), CropConfig(pool=3000))
    offset = np.array([shift * shape.size, 0, 0])
    condition = Condition(condition.points + offset, condition.on, condition.triangles + offset)
    return Pair(cloud, condition, 0.0, shape.size, shape.name, "one")


def test_all_baselines_find_a_lone_box_with_its_exact_mesh():
    exact = pair()
    for rule in (NearMesh(0.002), Connected(0.05, 0.5)):
        assert pooled(rule, [exact]).f1 > 0.97
    box = pooled(BoxCrop(0.0), [exact])
    assert box.recall == 1
    assert box.precision > 0.9
    assert pooled(BoxCrop(0.1), [exact]).precision < box.precision


def test_a_shifted_mesh_misleads_distance_more_than_connectivity():
    shifted = pair(0.15)
    near, connected = pooled(NearMesh(0.02), [shifted]), pooled(Connected(0.2, 0.5), [shifted])
    assert connected.f1 > 0.95
    assert near.f1 < 0.8


def test_the_best_settings_are_chosen_by_f1():
    shifted = pair(0.1)
    for grid in GRIDS.values():
        best = pooled(chosen(grid, [shifted]), [shifted]).f1
        assert best == pytest.approx(max(pooled(rule, [shifted]).f1 for rule in grid))


def test_scores_by_height_and_size_add_up():
    one = pair()
    labels = NearMesh(0.05)(one)
    scored = score([one, one], [labels, one.cloud.label])
    assert scored.row()["F1"] == pytest.approx(scored.total.f1)
    for parts in (scored.by_height, scored.by_size, scored.by_family):
        total = sum(parts.values(), start=type(scored.total)())
        assert total == scored.total
    assert list(scored.by_family) == ["carton"]
    assert scored.mean_f1 == pytest.approx((score([one], [labels]).total.f1 + 1) / 2)
    height = np.abs(one.cloud.points[:, 1])
    near = (height <= 0.02).sum()
    counted = scored.near_support
    assert 2 * near == (
        counted.true_positive
        + counted.false_positive
        + counted.false_negative
        + counted.true_negative
    )
