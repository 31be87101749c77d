from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.segmentation.mask_agreement import agreement
from garden_models.segmentation.point_visibility import sight
from garden_models.segmentation.scene_in_gv import scene_in_gv
from tests.garden_models.segmentation.ray_scene import (
    RayScene,
    Solid,
    look_at,
    render,
    table_with,
)

CRATE = Solid("box", (0, -0.1, 0), (0.1, 0.1, 0.08), (200, 60, 40), 1, yaw=0.4)
SCREEN = Solid("box", (0, -0.2, -0.45), (0.2, 0.2, 0.01), (30, 30, 30), 2)


@pytest.fixture(scope="module")
def room():
    angles = np.radians([0, 40, 180])
    cameras = [look_at((1.2 * np.sin(a), -0.7, -1.2 * np.cos(a)), (0, -0.1, 0)) for a in angles]
    scene = RayScene(table_with((CRATE,)), cameras, size=(120, 90), focal=120.0)
    reconstruction, gravity, labels = render(scene)
    in_gv = scene_in_gv(reconstruction, gravity)
    own = (np.abs(in_gv.cloud.xyz - CRATE.centre) < 0.13).all(1) & (in_gv.cloud.xyz[:, 1] < -0.02)
    return in_gv, labels, own


def found(room, view, mask):
    scene, _, own = room
    one = scene.reconstruction.views[view]
    return agreement(mask, one, sight(scene.cloud, one, scene.cameras[view]), scene.cloud, own)


@pytest.mark.parametrize("view", [0, 1, 2])
def test_the_true_mask_agrees(room, view) -> None:
    result = found(room, view, room[1][view] == 1)
    assert result.ok and result.held > 0.9 and result.near > 0.95


def test_a_mask_of_the_wall_behind_does_not(room) -> None:
    result = found(room, 0, room[1][0] == 91)
    assert not result.ok and result.held < 0.05 and result.near < 0.05


def test_a_mask_of_everything_does_not(room) -> None:
    result = found(room, 0, np.ones_like(room[1][0], bool))
    assert not result.ok and result.held > 0.9 and result.near < 0.6


def test_an_empty_mask_does_not(room) -> None:
    assert not found(room, 0, np.zeros_like(room[1][0], bool)).ok


def test_where_nothing_can_be_compared_nothing_agrees(room) -> None:
    scene, labels, own = room
    view = scene.reconstruction.views[0]
    blind = replace(view, depth=np.zeros_like(view.depth))
    seen = sight(scene.cloud, blind, scene.cameras[0])
    nothing = agreement(labels[0] == 1, blind, seen, scene.cloud, np.zeros_like(own))
    assert not nothing.ok and np.isnan([nothing.held, nothing.near]).all()
