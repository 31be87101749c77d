"""GeoCalib's adapter: up in the camera becomes down in the world; consensus leaves out the wild."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.geocalib import estimate, per_view
from garden_models.photo_gravity.geocalib import WEIGHTS, load
from garden_models.photo_gravity.photo_gravity import (
    PhotoGravity,
    PhotoGravityRequest,
    ReadPhotoGravity,
)
from garden_models.scene import BadInput, Reconstruction
from tasks.model.checked import check_answer
from tests.garden_models.gravity.synthetic_room import Room, cameras_only


class Published:
    """What ``cvg/GeoCalib`` publishes, as far as it is used; it knows the truth.

    ``calibrate`` takes (3, h, w) RGB in 0..1 and a focal length of one element, and gives UP.
    """

    def __init__(self, reconstruction: Reconstruction, down: np.ndarray, wrong: tuple[int, ...]):
        self._views = iter(enumerate(reconstruction.views))
        self._down = down
        self._wrong = wrong

    def to(self, device: str) -> Published:
        assert device == "cpu"
        return self

    def eval(self) -> Published:
        return self

    def calibrate(
        self, image: torch.Tensor, camera_model: str, priors: dict[str, torch.Tensor]
    ) -> dict[str, object]:
        index, view = next(self._views)
        assert camera_model == "pinhole"
        assert image.dtype == torch.float32
        np.testing.assert_allclose(image.numpy().transpose(1, 2, 0) * 255, view.rgb, atol=1e-3)
        assert priors["focal"].numel() == 1
        assert float(priors["focal"]) == pytest.approx(view.K[0, 0])
        assert not torch.is_grad_enabled()
        up = -view.camera_from_world[:3, :3] @ self._down
        if index in self._wrong:
            up = np.array([1.0, 0, 0])
        return {
            "gravity": SimpleNamespace(vec3d=torch.from_numpy(up)[None]),
            "gravity_uncertainty": torch.tensor([0.02]),
        }


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Install the package and its weights; give what makes the adapter for a room."""

    def make(
        reconstruction: Reconstruction, down: np.ndarray, wrong: tuple[int, ...] = ()
    ) -> ReadPhotoGravity:
        def checkpoint(weights: str) -> Published:
            assert Path(weights) == tmp_path / WEIGHTS
            return Published(reconstruction, down, wrong)

        package = ModuleType("geocalib")
        package.GeoCalib = checkpoint  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "geocalib", package)
        (tmp_path / WEIGHTS).write_bytes(b"")
        return load(tmp_path, "cpu")

    return make


def test_up_in_every_camera_is_down_in_the_world(published):
    reconstruction, down = cameras_only(Room(photos=5, roll_deg=40.0))
    downs, sigmas = per_view(reconstruction, published(reconstruction, down))
    np.testing.assert_allclose(downs, np.tile(down, (5, 1)), atol=1e-6)
    np.testing.assert_allclose(sigmas, 0.02)


def test_its_answer_is_one_that_the_door_lets_through(published):
    reconstruction, down = cameras_only(Room(photos=2))
    views = reconstruction.views
    request = PhotoGravityRequest(
        tuple(view.rgb for view in views), np.array([view.K[0, 0] for view in views])
    )
    answer = published(reconstruction, down)(request)
    check_answer("geocalib", request, answer, PhotoGravity)
    two = PhotoGravity(2 * answer.down_camera, answer.sigma_rad)
    assert two.fits(request) == "a direction is not of unit length"
    none = PhotoGravity(answer.down_camera[:1], answer.sigma_rad[:1])
    assert none.fits(request) == "1 directions for 2 photos"


def test_consensus_leaves_out_photos_that_were_misread(published):
    reconstruction, down = cameras_only(Room(photos=6))
    errors = []
    for consensus in (False, True):
        ask = published(reconstruction, down, wrong=(1, 4))
        found = estimate(reconstruction, ask, consensus)
        errors.append(angle_between_deg(found.down_world, down))
    assert errors[0] > 10
    assert errors[1] < 1e-4


def test_missing_weights_and_a_missing_package_are_told_apart(tmp_path):
    with pytest.raises(BadInput, match=r"GeoCalib needs .*geocalib-pinhole.tar"):
        load(tmp_path, "cpu")
    (tmp_path / WEIGHTS).write_bytes(b"")
    with pytest.raises(BadInput, match="not installed"):
        load(tmp_path, "cpu")
