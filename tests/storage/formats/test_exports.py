"""Files that other programs open say what was put in."""

from __future__ import annotations

import io

import numpy as np
import trimesh
from PIL import Image

from storage.formats.glb import GlbNode, scene_glb
from storage.formats.ply import SH_C0, gaussians_ply, points_ply
from storage.formats.png import depth_png, mask_png, rgb_png


def test_points_ply_is_read_back_by_trimesh() -> None:
    rng = np.random.default_rng(0)
    xyz = rng.normal(size=(50, 3))
    rgb = rng.integers(0, 256, (50, 3)).astype(np.uint8)
    cloud = trimesh.load(io.BytesIO(points_ply(xyz, rgb, xyz)), file_type="ply")
    np.testing.assert_allclose(cloud.vertices, xyz, atol=1e-6)
    np.testing.assert_array_equal(cloud.colors[:, :3], rgb)


def test_gaussians_ply_holds_log_scales_logit_opacities_and_wxyz() -> None:
    means = np.zeros((2, 3))
    quaternions = np.tile([1.0, 0, 0, 0], (2, 1))
    rgb = np.array([[255, 0, 128], [0, 0, 0]], np.uint8)
    data = gaussians_ply(means, np.full((2, 3), 0.01), quaternions, np.full(2, 0.9), rgb)
    header, body = data.split(b"end_header\n", 1)
    names = [line.split()[-1].decode() for line in header.splitlines() if b"property" in line]
    table = np.frombuffer(body, np.float32).reshape(2, -1)
    columns = {name: table[:, i] for i, name in enumerate(names)}
    np.testing.assert_allclose(np.exp(columns["scale_0"]), 0.01, rtol=1e-5)
    np.testing.assert_allclose(1 / (1 + np.exp(-columns["opacity"])), 0.9, rtol=1e-5)
    np.testing.assert_allclose(0.5 + SH_C0 * columns["f_dc_0"], [1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(columns["rot_0"], 1.0)


def test_glb_keeps_names_poses_and_metres() -> None:
    box = trimesh.creation.box((1, 2, 3))
    pose = trimesh.transformations.translation_matrix([0, 0, 5])
    rgb = np.full((8, 3), 200, np.uint8)
    data = scene_glb(
        [
            GlbNode("crate", np.asarray(box.vertices), np.asarray(box.faces), rgb, pose),
            GlbNode("background", np.asarray(box.vertices), None, rgb, np.eye(4)),
        ]
    )
    scene = trimesh.load(io.BytesIO(data), file_type="glb", force="scene")
    matrix, _ = scene.graph.get("crate")
    np.testing.assert_allclose(matrix, pose)
    assert {"crate", "background"} <= set(scene.graph.nodes_geometry)


def test_depth_png_is_millimetres_with_zero_for_none() -> None:
    depth = np.array([[0.0, 1.2344], [70.0, 3.0]], np.float32)
    image = np.asarray(Image.open(io.BytesIO(depth_png(depth))))
    assert image.tolist() == [[0, 1234], [0, 3000]]


def test_mask_png_round_trip() -> None:
    mask = np.random.default_rng(0).random((9, 7)) > 0.5
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(mask_png(mask)))), mask)


def test_rgb_png_keeps_every_value_and_the_top_row_on_top() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    image = Image.open(io.BytesIO(rgb_png(rgb)))
    assert image.mode == "RGB"
    np.testing.assert_array_equal(np.asarray(image), rgb)
