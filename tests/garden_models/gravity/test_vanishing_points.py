"""Vanishing points of all views: lifted segments, modes, the effect of a wrong focal length."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from garden_models.geometry.camera import project
from garden_models.geometry.direction import axis_angle_deg
from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity import vanishing_points
from garden_models.gravity.vanishing_points import focal_tilt, lift_segments, long_segments
from tests.garden_models.gravity.synthetic_room import K, Room, cameras_only, make_room


@pytest.mark.parametrize("seed", range(3))
def test_upright_edges_give_gravity(seed: int) -> None:
    reconstruction, down = make_room(Room(seed=seed))
    evidence = vanishing_points.estimate(reconstruction)
    assert evidence is not None
    assert angle_between_deg(evidence.down_world, down) < 0.5


def test_segment_is_found_to_a_fifth_of_a_pixel() -> None:
    picture = np.full((120, 160, 3), 40, np.uint8)
    corners = np.array([[30, 20], [110, 20], [110, 90], [30, 90]])
    cv2.fillPoly(picture, [corners], (200, 200, 200))
    upright = [s for s in long_segments(picture) if abs(s[0] - s[2]) < 1]
    # The painted pixels end with their cells: column 110 reaches to x = 111.
    found = sorted(float(s[[0, 2]].mean()) for s in upright)
    np.testing.assert_allclose(found, [30.0, 111.0], atol=0.2)


def test_normals_are_perpendicular_to_the_edge_in_space() -> None:
    reconstruction, down = cameras_only(Room(photos=5))
    start = np.linalg.inv(np.vstack([reconstruction.views[2].camera_from_world, [0, 0, 0, 1]]))
    foot = (start @ [0.0, 0.2, 1.7, 1])[:3]
    views = []
    for view in reconstruction.views:
        pixels, _ = project(np.array([foot, foot - 0.5 * down]), K, view.camera_from_world)
        picture = np.full(view.rgb.shape, 40, np.uint8)
        along = pixels[1] - pixels[0]
        side = np.array([along[1], -along[0]]) / np.linalg.norm(along) * 60
        quad = np.array([pixels[0], pixels[1], pixels[1] + side, pixels[0] + side]) - 0.5
        cv2.fillPoly(
            picture, [np.round(quad * 256).astype(int)], (220, 220, 220), cv2.LINE_AA, shift=8
        )
        views.append(replace(view, rgb=picture))
    segments = lift_segments(replace(reconstruction, views=tuple(views)))
    residual = np.abs(segments.normals_world @ down)
    upright = residual < 0.05
    assert set(segments.view[upright]) == set(range(5))
    assert (residual[upright] < 3 * segments.sigma_rad[upright]).mean() > 0.8


def test_focal_tilt_is_what_a_longer_lens_does() -> None:
    reconstruction, down = cameras_only(Room(photos=1, pitch_deg=30))
    rotation = reconstruction.views[0].camera_from_world[:3, :3]
    in_camera = rotation @ down
    moved = rotation.T @ (in_camera / [1.01, 1.01, 1.0])
    expected = np.radians(axis_angle_deg(moved, down))
    tilt = np.sqrt(np.trace(focal_tilt(rotation[None], down, 0.01)))
    assert tilt == pytest.approx(expected, rel=0.02)


def test_given_cameras_are_trusted_less_than_estimated_ones() -> None:
    reconstruction, _ = make_room(Room())
    known = replace(reconstruction, cameras_source="known")
    cues = [vanishing_points.read(r) for r in (reconstruction, known)]
    assert all(cue is not None for cue in cues)
    assert cues[1].modes[0].sigma_deg > cues[0].modes[0].sigma_deg


def test_blank_photos_say_nothing() -> None:
    reconstruction, _ = cameras_only(Room())
    assert vanishing_points.estimate(reconstruction) is None


def test_it_names_directions_without_claiming_one() -> None:
    cue = vanishing_points.read(make_room(Room())[0])
    assert cue is not None
    assert not cue.claims_vertical
    assert sum(mode.probability for mode in cue.modes) < 1
