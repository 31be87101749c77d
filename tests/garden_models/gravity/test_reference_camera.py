"""The reference camera's own frame in place of gravity's."""

from __future__ import annotations

import dataclasses

import numpy as np

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.align import align_gravity
from garden_models.gravity.config import AlignGravity
from garden_models.gravity.reference_camera import estimate
from tests.garden_models.gravity.synthetic_room import Room, make_room


def test_alone_it_makes_gravity_view_the_reference_cameras_frame() -> None:
    reconstruction, down = make_room(Room(seed=3))
    found = align_gravity(reconstruction, AlignGravity(methods=("reference_camera",)))
    view = next(v for v in reconstruction.views if v.photo == found.reference_photo)
    np.testing.assert_allclose(
        found.gv_from_world[:3, :3], view.camera_from_world[:, :3], atol=0.02
    )
    assert found.verdict.status == "degraded"
    assert angle_between_deg(found.down_world, down) > 5


def test_without_cameras_it_says_nothing() -> None:
    reconstruction, _ = make_room(Room(seed=3))
    assert estimate(dataclasses.replace(reconstruction, views=())) is None
