"""What a package holds opens in Open3D as it was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from storage.formats.glb import GlbNode, scene_glb
from storage.formats.ply import points_ply
from tests.open3d_library import open3d


def test_points_with_colours_and_normals(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    xyz = rng.normal(size=(200, 3))
    rgb = rng.integers(0, 256, (200, 3), dtype=np.uint8)
    normal = xyz / np.linalg.norm(xyz, axis=1, keepdims=True)
    (tmp_path / "points.ply").write_bytes(points_ply(xyz, rgb, normal))
    cloud = open3d.io.read_point_cloud(str(tmp_path / "points.ply"))
    np.testing.assert_allclose(np.asarray(cloud.points), xyz, atol=1e-6)
    np.testing.assert_allclose(np.asarray(cloud.normals), normal, atol=1e-6)
    np.testing.assert_array_equal(np.round(np.asarray(cloud.colors) * 255), rgb)


def test_meshes_stand_where_their_node_puts_them(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(2)
    place = np.eye(4)
    place[:3, 3] = 1, 2, 3
    rgb = np.full((len(ball.vertices), 3), 200, np.uint8)
    node = GlbNode("ball", ball.vertices, ball.faces, rgb, place)
    (tmp_path / "scene.glb").write_bytes(scene_glb([node]))
    mesh = open3d.io.read_triangle_mesh(str(tmp_path / "scene.glb"))
    mesh.merge_close_vertices(1e-6)
    assert mesh.is_watertight()
    np.testing.assert_allclose(mesh.get_center(), [1, 2, 3], atol=1e-5)
