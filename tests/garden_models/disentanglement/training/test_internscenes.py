"""Rooms of InternScenes' layout, read from a small made-up folder of that form."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from garden_models.disentanglement.training.crop import turned
from garden_models.disentanglement.training.pairs import pairs_of_room
from garden_models.disentanglement.training.pairs_config import CLEAN
from garden_models.disentanglement.training.scenes.internscenes import (
    canonical_turn,
    read_layout,
    read_room,
)
from garden_models.scene import BadInput

ANGLES = [0.4, 0.02, -0.03]


def entry(**changes):
    return {
        "id": 1,
        "category": "chair",
        "model_uid": "gr100/chair_7",
        "bbox": [1.0, 2.0, 0.45, 0.5, 0.6, 0.9, *ANGLES],
    } | changes


@pytest.fixture
def data(tmp_path):
    """Write one scan: a chair, a box from PartNet, a curtain, an unmatched object, a floor."""
    assets = tmp_path / "asset_library"
    (assets / "gr100").mkdir(parents=True)
    (assets / "partnet_mobility" / "12").mkdir(parents=True)
    # An asset as it is stored: y up, off its centre; a wedge tells its sides apart.
    wedge = trimesh.Trimesh(
        [[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4], [2, 0, 4], [0, 3, 4]],
        [[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [0, 3, 5], [0, 5, 2]],
    )
    wedge.export(assets / "gr100" / "chair_7.glb")
    trimesh.creation.box((1, 1, 1)).export(assets / "partnet_mobility" / "12" / "whole.glb")
    trimesh.creation.box((1, 1, 1)).export(assets / "gr100" / "curtain.glb")
    scan = tmp_path / "Layout_info" / "scannet" / "scene0000_00"
    (scan / "StructureMesh").mkdir(parents=True)
    floor = trimesh.creation.box((6, 0.02, 6))
    floor.apply_translation([1, -0.01, -2])  # saved with y up: z of the layout is y, y is -z
    floor.export(scan / "StructureMesh" / "floor.glb")
    layout = [
        entry(),
        entry(
            id=2,
            category="box",
            model_uid="partnet_mobility/12",
            bbox=[2, 2, 0.2, 0.4, 0.4, 0.4, 0, 0, 0],
        ),
        entry(
            id=3, category="curtain", model_uid="gr100/curtain", bbox=[1, 3, 1, 1, 0.1, 2, 0, 0, 0]
        ),
        entry(id=4, model_uid=""),
    ]
    (scan / "layout.json").write_text(json.dumps(layout))
    return scan / "layout.json", assets


def test_a_layout_becomes_a_room_with_y_down(data):
    room = read_room(*data)
    assert [i.shape.family for i in room.instances] == ["chair", "box"]
    assert {s.name for s in room.structure} == {"3", "floor"}
    box = room.instances[1]
    np.testing.assert_allclose(box.box, [[1.8, -0.4, 1.8], [2.2, 0.0, 2.2]], atol=1e-6)
    floor = next(s for s in room.structure if s.name == "floor")
    np.testing.assert_allclose(floor.vertices[:, 1].min(), 0.0, atol=1e-6)
    low, high = floor.vertices.min(axis=0), floor.vertices.max(axis=0)
    assert low[0] <= 1.0 <= high[0]
    assert low[2] <= 2.0 <= high[2]


def test_an_object_is_turned_and_scaled_as_the_layouts_own_tool_does(data):
    """Compose the chair with trimesh's Euler angles, as the data's reference code states them."""
    layout, assets = data
    mesh = trimesh.load(assets / "gr100" / "chair_7.glb", force="mesh")
    vertices = np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)
    rotation = trimesh.transformations.rotation_matrix
    canonical = rotation(np.pi / 2, [0, 0, 1]) @ rotation(np.pi / 2, [1, 0, 0])
    vertices = vertices @ canonical[:3, :3].T
    vertices = vertices * (np.array([0.5, 0.6, 0.9]) / np.ptp(vertices, axis=0))
    euler = trimesh.transformations.euler_matrix(*ANGLES, axes="rzxy")
    vertices = vertices @ euler[:3, :3].T + [1.0, 2.0, 0.45]
    expected = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
    found = read_room(layout, assets).instances[0].vertices
    for vertex in expected:
        assert np.linalg.norm(found - vertex, axis=1).min() < 1e-6


def test_its_objects_make_pairs(data):
    room = read_room(*data)
    pairs = pairs_of_room(room, (0, 0), CLEAN)
    assert {pair.shape for pair in pairs} == {"gr100/chair_7", "partnet_mobility/12"}
    assert len(turned(room, 0.0).corners) > 100


def test_partnet_pens_get_two_more_turns():
    plain = canonical_turn("partnet_mobility/5", "Box", 0.0)
    pen = canonical_turn("partnet_mobility/5", "Pen", 0.0)
    np.testing.assert_allclose(plain @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    assert not np.allclose(plain, pen)
    turned_front = canonical_turn("objaverse/x", "chair", 90.0) @ [0, 0, 1]
    np.testing.assert_allclose(
        turned_front,
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]] @ (canonical_turn("gr100/x", "c", 0.0) @ [0, 0, 1]),
        atol=1e-12,
    )


def test_what_cannot_be_read_is_named(data, tmp_path):
    layout, assets = data
    with pytest.raises(BadInput, match="cannot be read"):
        read_layout(tmp_path / "none.json")
    for changes, said in (
        ({"bbox": [0, 0, 0, 1, -1, 1, 0, 0, 0]}, "positive sizes"),
        ({"bbox": [1, 2]}, "nine"),
        ({"bbox": "none"}, "needs id"),
    ):
        layout.write_text(json.dumps([entry(**changes)]))
        with pytest.raises(BadInput, match=said):
            read_room(layout, assets)
    layout.write_text(json.dumps([entry(model_uid="gr100/lost")]))
    with pytest.raises(BadInput, match="neither"):
        read_room(layout, assets)
    (assets / "unknown").mkdir()
    trimesh.creation.box((1, 1, 1)).export(assets / "unknown" / "a.glb")
    layout.write_text(json.dumps([entry(model_uid="unknown/a")]))
    with pytest.raises(BadInput, match="no known source"):
        read_room(layout, assets)
