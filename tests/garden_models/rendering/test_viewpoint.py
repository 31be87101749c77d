"""Where a person looks from: the photo's side, upright, near; bodies as points at rest."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rigid import rigid, transform_points
from garden_models.rendering.mesh_points import mesh_points, settled_poses
from garden_models.rendering.turntable import Turntable, turn_mesh
from garden_models.rendering.viewpoint import bounding_sphere, intrinsics, viewpoint_towards
from garden_models.scene import BodyMotion, Scale, SimScene, Trajectory
from tests.garden_models.rendering.test_hybrid import at, ball


def test_the_view_is_from_the_photos_side_and_upright() -> None:
    centre, eye = np.array([1.0, 0.5, 2.0]), np.array([3.0, -0.5, -1.0])
    view = viewpoint_towards(centre, 0.2, eye, share=0.5)
    camera = view.camera_from_gv
    stands = -camera[:, :3].T @ camera[:, 3]
    towards_eye = (eye - centre) / np.linalg.norm(eye - centre)
    np.testing.assert_allclose((stands - centre) / view.distance, towards_eye, atol=1e-9)
    assert camera[1, 1] > 0  # gravity points down in the picture
    assert camera[0, 1] == pytest.approx(0, abs=1e-12)
    top = centre - [0, 0.2, 0]
    pixel = intrinsics((400, 300)) @ transform_points(camera, top[None])[0]
    assert pixel[0] / pixel[2] == pytest.approx(200)
    assert 50 < pixel[1] / pixel[2] < 100


def test_the_view_is_no_farther_than_the_photo_and_outside_the_objects() -> None:
    centre = np.zeros(3)
    near = viewpoint_towards(centre, 0.5, np.array([0, -0.2, -1.0]), share=0.2)
    assert near.distance == pytest.approx(np.sqrt(1.04))
    inside = viewpoint_towards(centre, 0.5, np.array([0, 0, -0.1]), share=0.5)
    assert inside.distance == pytest.approx(0.75)
    steep = viewpoint_towards(centre, 0.1, np.array([0, -1.0, -0.01]), share=0.5)
    assert steep.elevation_deg == 65.0
    assert np.isfinite(viewpoint_towards(centre, 0.1, centre, share=0.5).camera_from_gv).all()
    assert steep.from_above().camera_from_gv[2, 1] == pytest.approx(1.0, abs=1e-4)


def test_bodies_as_points_where_they_came_to_rest() -> None:
    body = ball("a", radius=0.2)
    scene = SimScene((body,), (), Scale("known_cameras"))
    still = settled_poses(scene, None)
    np.testing.assert_array_equal(still[0], body.gv_from_body)
    trajectory = Trajectory(
        np.array([0.0, 1.0]),
        np.array([[[0.0, 0, 0]], [[0, 0.7, 0]]]),
        np.tile([1.0, 0, 0, 0], (2, 1, 1)),
        (BodyMotion("a", 0, 0.7, 0, True),),
    )
    (pose,) = settled_poses(scene, trajectory)
    np.testing.assert_allclose(pose, at(0, 0.7, 0))
    points = mesh_points(body, pose, 2000)
    centre, radius = bounding_sphere([points.xyz])
    np.testing.assert_allclose(centre, [0, 0.7, 0], atol=0.01)
    assert radius == pytest.approx(0.2 * np.sqrt(3), rel=0.03)  # of the box around it
    assert (points.rgb == [250, 20, 20]).all()
    assert points.spacing[0] == pytest.approx(np.sqrt(4 * np.pi * 0.04 / 2000), rel=0.02)


@pytest.mark.parametrize("stretch", [(1, 1, 1), (3, 1, 1), (1, 0.1, 1)])
def test_objects_fill_the_turntables_pictures(stretch: tuple[float, float, float]) -> None:
    """The largest picture is filled to its margin; all have one scale and stay inside."""
    body = ball("a")
    turned = transform_points(rigid(np.eye(3), np.array([5.0, 1, 2])), body.vertices * stretch)
    pictures = turn_mesh(turned, body.faces, body.vertex_rgb, Turntable(size=(120, 120)))
    extents = []
    for picture in pictures:
        rows, columns = np.nonzero((picture != 240).any(axis=2))
        assert min(rows.min(), columns.min()) >= 2
        assert max(rows.max(), columns.max()) <= 117
        extents.append((np.ptp(columns) + 1, np.ptp(rows) + 1))
        assert abs(columns.min() + columns.max() - 119) <= 3  # centred
    assert 105 <= np.max(extents) <= 112
