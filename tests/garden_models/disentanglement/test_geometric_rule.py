"""The geometric rule takes the object, and leaves table, touching neighbour and far things."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.disentanglement.label import LabelPoints, label_points
from garden_models.disentanglement.protocol import METHODS, classifier
from garden_models.scene import BadInput
from tests.garden_models.disentanglement.table_top import BALL, BOX, GHOST, TABLE, table_top


def labels(scene, **changes):
    return label_points(
        scene.reconstruction,
        scene.gravity_view,
        changes.get("masks", scene.masks),
        changes.get("mesh", scene.mesh),
        changes.get("placement", scene.placement),
    )


def test_the_object_goes_and_everything_else_stays():
    scene = table_top()
    got = labels(scene)
    gone = got.probability >= got.threshold
    xyz = scene.reconstruction.points_world.xyz
    assert gone[scene.truth == BOX].mean() > 0.99
    assert gone[scene.truth == BALL].mean() < 0.03
    assert gone[scene.truth == GHOST].mean() > 0.9
    # Table points that go lie at the box's foot, where masks and noise overlap.
    lost = xyz[(scene.truth == TABLE) & gone]
    assert gone[scene.truth == TABLE].mean() < 0.02
    if len(lost):
        assert (np.abs(lost[:, [0, 2]]) < [0.08 + 0.025, 0.06 + 0.025]).all()
    assert got.verdict.status == "ok"
    assert ((got.probability >= 0) & (got.probability <= 1)).all()


def test_masks_tell_a_touching_neighbour_that_the_mesh_cannot():
    """Without masks the ball's side at the box is lost; with them it stays."""
    scene = table_top()
    none = tuple(np.zeros_like(mask) for mask in scene.masks.masks)
    blind = labels(scene, masks=replace(scene.masks, masks=none))
    with_masks = labels(scene)
    near = (scene.truth == BALL) & (scene.reconstruction.points_world.xyz[:, 0] < 0.09)
    assert (blind.probability[near] >= 0.5).sum() > (with_masks.probability[near] >= 0.5).sum()


def test_what_the_mesh_lacks_goes_by_the_masks():
    """A mesh without its upper quarter: the masks still take the box's top."""
    scene = table_top()
    vertices = scene.mesh.vertices * [1, 0.75, 1]
    got = labels(scene, mesh=replace(scene.mesh, vertices=vertices))
    assert (got.probability[scene.truth == BOX] >= 0.5).mean() > 0.97


def test_a_slightly_wrong_placement_does_no_harm():
    scene = table_top()
    hypothesis = replace(scene.placement.best, translation_gv=np.array([0.004, 0.003, -0.004]))
    got = labels(scene, placement=replace(scene.placement, hypotheses=(hypothesis,)))
    gone = got.probability >= 0.5
    assert gone[scene.truth == BOX].mean() > 0.98
    assert gone[scene.truth == BALL].mean() < 0.05
    assert gone[scene.truth == TABLE].mean() < 0.03


def test_nothing_there_is_degraded():
    scene = table_top()
    hypothesis = replace(scene.placement.best, translation_gv=np.array([0.0, -5.0, 0.0]))
    got = labels(scene, placement=replace(scene.placement, hypotheses=(hypothesis,)))
    assert got.verdict.status == "degraded"
    assert (got.probability == 0).all()


def test_wrong_input_is_refused():
    scene = table_top()
    with pytest.raises(BadInput, match="different targets"):
        labels(scene, mesh=replace(scene.mesh, name="mug"))
    with pytest.raises(BadInput, match="other photos"):
        labels(scene, masks=replace(scene.masks, photos=("x.jpg",)))
    with pytest.raises(BadInput, match="choose one of geometric"):
        classifier("magic")
    assert all(callable(classifier(name)) for name in METHODS)
    assert LabelPoints().method in METHODS
