"""The background has neither the object nor a hole where it stood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from garden_models.disentanglement.fill import clean_background
from garden_models.disentanglement.inpainting import inpaint, nearest_fill
from garden_models.disentanglement.label import label_points
from garden_models.scene import BadInput
from tests.garden_models.disentanglement.table_top import (
    BALL,
    BOX,
    GHOST,
    SPACING,
    TABLE,
    stripes,
    table_top,
)


@pytest.fixture(scope="module")
def cleaned():
    scene = table_top()
    label = label_points(
        scene.reconstruction, scene.gravity_view, scene.masks, scene.mesh, scene.placement
    )
    background = clean_background(
        scene.reconstruction, scene.gravity_view, (label,), (scene.masks,)
    )
    return scene, label, background


def test_nothing_of_the_object_is_left(cleaned):
    scene, label, background = cleaned
    xyz = scene.reconstruction.points_world.xyz
    left = {tuple(p) for p in background.points_gv.xyz[~background.filled]}
    for what in (BOX, GHOST):
        points = xyz[(scene.truth == what) & (np.abs(xyz[:, 1]) > 0.03)]
        assert np.mean([tuple(p) in left for p in points]) < 0.01
    assert background.removed["box"] >= (label.probability >= 0.5).sum()
    assert np.mean([tuple(p) in left for p in xyz[scene.truth == BALL]]) > 0.97
    assert background.verdict.status == "ok"


def test_there_is_no_hole(cleaned):
    """Every place of the footprint has a background point within two spacings."""
    _, _, background = cleaned
    x, z = np.meshgrid(np.linspace(-0.1, 0.1, 40), np.linspace(-0.08, 0.08, 40))
    places = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    distance, _ = cKDTree(background.points_gv.xyz).query(places)
    assert distance.max() < 2 * SPACING
    filled = background.points_gv.xyz[background.filled]
    assert np.abs(filled[:, 1]).max() < 0.004
    np.testing.assert_allclose(background.points_gv.normal[background.filled][:, 1], -1, atol=1e-2)
    assert (background.points_gv.confidence[background.filled] == 0).all()


def test_the_pattern_goes_on_under_the_object(cleaned):
    """Filled colours follow the table's stripes."""
    _, _, background = cleaned
    points = background.points_gv.subset(background.filled)
    under = (np.abs(points.xyz[:, 0]) < 0.08) & (np.abs(points.xyz[:, 2]) < 0.06)
    error = np.abs(points.rgb[under].astype(float) - stripes(points.xyz[under, 0]))
    assert np.median(error) < 12
    assert (error.max(axis=1) < 40).mean() > 0.8


def test_filled_points_stay_on_the_support(cleaned):
    _, _, background = cleaned
    filled = background.points_gv.xyz[background.filled]
    assert (np.abs(filled[:, [0, 2]]) <= 0.6).all()


def test_without_support_nothing_is_filled():
    scene = table_top()
    label = label_points(
        scene.reconstruction, scene.gravity_view, scene.masks, scene.mesh, scene.placement
    )
    masks = replace(scene.masks, support=None)
    background = clean_background(scene.reconstruction, scene.gravity_view, (label,), (masks,))
    assert not background.filled.any()
    assert "no hole was filled" in background.verdict.reasons[0]


def test_no_targets_leave_the_scene_as_it_is():
    scene = table_top()
    background = clean_background(scene.reconstruction, scene.gravity_view, (), ())
    assert len(background.points_gv) == len(scene.reconstruction.points_world)
    assert background.removed == {}
    assert (scene.truth == TABLE).any()


def test_labels_of_another_cloud_are_refused():
    scene = table_top()
    label = label_points(
        scene.reconstruction, scene.gravity_view, scene.masks, scene.mesh, scene.placement
    )
    short = replace(label, probability=label.probability[:-1])
    with pytest.raises(BadInput, match="label it again"):
        clean_background(scene.reconstruction, scene.gravity_view, (short,), (scene.masks,))
    with pytest.raises(BadInput, match="same targets"):
        clean_background(scene.reconstruction, scene.gravity_view, (label,), ())


def test_inpainting_continues_lines_and_keeps_what_is_known():
    y, x = np.mgrid[0:64, 0:64]
    picture = np.stack([((x + y) // 6 % 2) * 180.0 + 40] * 3, axis=2)
    hole = (np.abs(x - 32) < 10) & (np.abs(y - 32) < 10)
    got = inpaint(picture, ~hole, hole)
    assert (got[~hole] == picture[~hole].astype(np.float32)).all()
    assert np.abs(got - picture)[hole].mean() < 30
    smooth = np.stack([x * 2.0, y * 2.0, x + y], axis=2)
    assert np.abs(inpaint(smooth, ~hole, hole) - smooth)[hole].mean() < 10
    with pytest.raises(ValueError, match="nothing"):
        inpaint(picture, np.zeros_like(hole), hole)
    assert (nearest_fill(np.ones((4, 4, 3)), np.eye(4, dtype=bool)) == 1).all()
