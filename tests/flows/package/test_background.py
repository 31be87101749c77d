"""The background's Gaussians in the file that 3DGS viewers read."""

from __future__ import annotations

import numpy as np

from flows.package.background import background_files
from garden_models.geometry.rotation import axis_angle, quaternion_from_matrix
from garden_models.reconstruction.geometry_model import Gaussians
from garden_models.scene import Background, PointCloud

SH_C0 = 0.28209479177387814


def read_ply(data: bytes) -> np.ndarray:
    head, body = data.split(b"end_header\n", 1)
    names = [line.split()[2].decode() for line in head.splitlines() if line.startswith(b"property")]
    return np.frombuffer(body, [(name, "<f4") for name in names])


def background(filled: list[bool]) -> Background:
    n = len(filled)
    points = PointCloud(
        np.zeros((n, 3), np.float32),
        np.full((n, 3), 255, np.uint8),
        np.tile(np.float32([0, -1, 0]), (n, 1)),
        np.full(n, 0.1, np.float32),
        np.ones(n, np.float32),
    )
    return Background(points, np.array(filled), {})


def test_predicted_gaussians_are_written_with_discs_in_filled_holes():
    turn = axis_angle(np.array([0.0, 1.0, 0.0]), 0.5)
    gaussians = Gaussians(
        np.float32([[1, 2, 3]]),
        np.float32([[0.1, 0.2, 0.3]]),
        quaternion_from_matrix(turn)[None].astype(np.float32),
        np.float32([1.0]),
        np.float32([[0.2, 0.5, 0.9]]),
        np.array([0]),
    )
    table = read_ply(
        background_files(background([False, True, False]), gaussians)["background/splat.ply"]
    )
    assert len(table) == 2  # the Gaussian and one disc: seen points are in the Gaussians
    one = table[0]
    np.testing.assert_allclose([one["x"], one["y"], one["z"]], [1, 3, -2], atol=1e-6)  # z up
    np.testing.assert_allclose(
        np.exp([one["scale_0"], one["scale_1"], one["scale_2"]]), [0.1, 0.2, 0.3], rtol=1e-5
    )
    assert np.isfinite(one["opacity"]) and 1 / (1 + np.exp(-one["opacity"])) > 0.999
    np.testing.assert_allclose(0.5 + SH_C0 * one["f_dc_2"], 0.9, atol=0.003)
    wxyz = np.array([one[f"rot_{i}"] for i in range(4)], float)
    zup = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
    expected = quaternion_from_matrix(zup @ turn)
    np.testing.assert_allclose(np.abs(wxyz @ expected), 1, atol=1e-6)


def test_without_gaussians_every_point_is_a_disc():
    files = background_files(background([False, True, False]), None)
    assert len(read_ply(files["background/splat.ply"])) == 3
