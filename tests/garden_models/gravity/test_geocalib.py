"""GeoCalib's adapter: up in the camera becomes down in the world; consensus leaves out the wild."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.geocalib import estimate, load_geocalib, per_view
from garden_models.scene import BadInput
from tests.garden_models.gravity.synthetic_room import Room, cameras_only


def calibrator(reconstruction, down, wrong=()):
    """Return what GeoCalib would say of each photo: UP in its camera, in their order."""
    views = iter(enumerate(reconstruction.views))

    def calibrate(rgb, focal):
        index, view = next(views)
        assert focal == view.K[0, 0]
        up = -view.camera_from_world[:3, :3] @ down
        return (np.array([1.0, 0, 0]) if index in wrong else up), 0.02

    return calibrate


def test_up_in_every_camera_is_down_in_the_world():
    reconstruction, down = cameras_only(Room(photos=5, roll_deg=40.0))
    downs, sigmas = per_view(reconstruction, calibrator(reconstruction, down))
    np.testing.assert_allclose(downs, np.tile(down, (5, 1)), atol=1e-9)
    np.testing.assert_allclose(sigmas, 0.02)


def test_consensus_leaves_out_photos_that_were_misread():
    reconstruction, down = cameras_only(Room(photos=6))
    errors = []
    for consensus in (False, True):
        calibrate = calibrator(reconstruction, down, wrong=(1, 4))
        found = estimate(reconstruction, calibrate, consensus)
        errors.append(angle_between_deg(found.down_world, down))
    assert errors[0] > 10
    assert errors[1] < 1e-4


def test_missing_weights_and_a_missing_package_are_told_apart(tmp_path):
    with pytest.raises(BadInput, match="no such GeoCalib weights"):
        load_geocalib(tmp_path / "none.tar")
    (tmp_path / "pinhole.tar").write_bytes(b"")
    with pytest.raises(BadInput, match="not installed"):
        load_geocalib(tmp_path / "pinhole.tar")
