from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.geometry.rigid import transform_points
from garden_models.geometry.rotation import yaw_gv
from garden_models.metrics.placement import pose_error, shape_error, yaw_difference_deg
from tests.garden_models.meshing.staged import block


def _moved(yaw_deg: float, shift: tuple[float, float, float], scale: float = 1.0) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3] = scale * yaw_gv(np.radians(yaw_deg))
    out[:3, 3] = shift
    return out


@pytest.mark.parametrize(
    ("yaw", "symmetry", "expected"),
    [(10, 1, 10), (-10, 1, 10), (190, 1, 170), (170, 2, 10), (92, 4, 2), (77, None, 0)],
)
def test_symmetric_headings_count_as_equal(
    yaw: float, symmetry: int | None, expected: float
) -> None:
    assert yaw_difference_deg(np.radians(yaw), 0.0, symmetry) == pytest.approx(expected)


def test_pose_error_reads_yaw_translation_and_scale() -> None:
    error = pose_error(
        _moved(25, (0.3, 0.0, 0.4), 1.1), _moved(10, (0.0, 0.0, 0.0)), np.zeros(3), 2.0
    )
    assert error.yaw_deg == pytest.approx(15)
    assert error.translation == pytest.approx(0.25)
    assert error.scale == pytest.approx(1.1)
    assert error.tilt_deg == pytest.approx(0, abs=1e-5)


def test_pose_error_reads_tilt() -> None:
    tilted = trimesh.transformations.rotation_matrix(0.2, [1, 0, 0])
    error = pose_error(tilted, np.eye(4), np.zeros(3), 1.0)
    assert error.tilt_deg == pytest.approx(np.degrees(0.2))


@pytest.mark.parametrize(("yaw", "shift"), [(12.0, (0.01, 0.0, -0.02)), (-20.0, (0.0, 0.01, 0.0))])
def test_shape_error_recovers_a_known_motion(yaw: float, shift: tuple[float, float, float]) -> None:
    mesh = block()
    vertices = np.asarray(mesh.vertices)
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    moved = transform_points(_moved(yaw, shift), vertices - centre) + centre
    error = shape_error(moved, mesh.faces, vertices, mesh.faces)
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    assert error.yaw_deg == pytest.approx(abs(yaw), abs=0.7)
    assert error.translation == pytest.approx(np.linalg.norm(shift) / size, abs=0.006)


def test_a_body_of_revolution_has_no_yaw_error() -> None:
    jar = trimesh.creation.cylinder(0.1, 0.3)
    jar.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    turned = transform_points(_moved(40, (0.0, 0.0, 0.0)), np.asarray(jar.vertices))
    error = shape_error(turned, jar.faces, np.asarray(jar.vertices), jar.faces, symmetry=None)
    assert error.yaw_deg == 0.0 and error.translation < 0.005
