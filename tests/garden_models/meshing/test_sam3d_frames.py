"""SAM-3D's frames, as its own code and maintainers state them, against ours."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garden_models.meshing.sam3d_frames import (
    camera_from_mesh,
    mesh_in_our_frame,
    points_in_pytorch3d,
)


def wxyz(rotation: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]]


@pytest.mark.parametrize("seed", range(6))
def test_a_pose_puts_the_exported_mesh_where_its_row_vector_formula_does(seed: int) -> None:
    """p_pytorch3d = s (p_canonical R(q)) + t, the mesh exported as p_canonical M, y up."""
    rng = np.random.default_rng(seed)
    canonical = rng.uniform(-0.5, 0.5, (40, 3))
    rotation = Rotation.random(random_state=seed).as_matrix()
    scale, shift = rng.uniform(0.1, 3.0), rng.normal(size=3)
    in_pytorch3d = scale * canonical @ rotation + shift
    exported = canonical @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])

    ours = mesh_in_our_frame(exported)
    pose = camera_from_mesh(wxyz(rotation), shift, scale)
    in_opencv = ours @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(in_opencv, in_pytorch3d * [-1, -1, 1], atol=1e-12)


def test_nothing_is_mirrored() -> None:
    pose = camera_from_mesh(wxyz(Rotation.random(random_state=3).as_matrix()), np.zeros(3), 2.0)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(8.0)
    corner = np.eye(3)
    assert np.linalg.det(mesh_in_our_frame(corner)) == pytest.approx(1.0)


def test_up_stays_up_in_every_frame() -> None:
    """A point above the middle: +z canonical, +y exported, -y ours, -y in a level camera."""
    above = np.array([[0.0, 0.0, 0.4]])
    exported = above @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose(exported, [[0, 0.4, 0]])
    np.testing.assert_allclose(mesh_in_our_frame(exported), [[0, -0.4, 0]])
    # A level PyTorch3D camera has y up: canonical (x, y, z) -> (x, z, -y), as row vectors.
    level = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
    pose = camera_from_mesh(wxyz(level), np.array([0, 0, 2.0]), 1.0)
    np.testing.assert_allclose(pose[:3, 1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3] @ [0, -0.4, 0] + pose[:3, 3], [0, -0.4, 2.0])


def test_a_quaternion_read_in_the_other_order_is_another_pose() -> None:
    rotation = Rotation.from_euler("xyz", [20, 50, -30], degrees=True).as_matrix()
    right = camera_from_mesh(wxyz(rotation), np.zeros(3), 1.0)
    wrong = camera_from_mesh(Rotation.from_matrix(rotation).as_quat(), np.zeros(3), 1.0)
    assert np.abs(right - wrong).max() > 0.3


def test_points_turn_to_pytorch3ds_axes_and_keep_their_holes() -> None:
    points = np.array([[[1.0, 2.0, 3.0], [np.nan] * 3]])
    turned = points_in_pytorch3d(points)
    np.testing.assert_allclose(turned[0, 0], [-1, -2, 3])
    assert np.isnan(turned[0, 1]).all()
