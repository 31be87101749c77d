"""Photos that few points hold are dropped; impossible lenses are refused."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest

from garden_models.reconstruction.registration_evidence import (
    drop_unsupported,
    is_plausible,
    photo_evidence,
    supported_models,
)


@pytest.fixture
def model() -> pycolmap.Reconstruction:
    pycolmap.set_random_seed(0)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=6, num_points3D=80
    )
    return pycolmap.synthesize_dataset(options)


def forget(model: pycolmap.Reconstruction, image_id: int, keep: int) -> None:
    image = model.images[image_id]
    for index in list(image.get_observation_point2D_idxs())[keep:]:
        model.delete_observation(image_id, index)


def test_every_photo_of_a_full_model_is_confirmed(model: pycolmap.Reconstruction) -> None:
    assert all(e.points == e.confirmed == 80 for e in photo_evidence(model).values())


def test_only_the_weak_photo_is_dropped(model: pycolmap.Reconstruction) -> None:
    weak = sorted(model.images)[2]
    forget(model, weak, 10)
    drop_unsupported(model, 15)
    assert weak not in photo_evidence(model)
    assert model.num_reg_images() == 5


def test_a_weak_photo_above_the_limit_stays(model: pycolmap.Reconstruction) -> None:
    forget(model, sorted(model.images)[2], 20)
    drop_unsupported(model, 15)
    assert model.num_reg_images() == 6


def test_a_bent_lens_is_refused(model: pycolmap.Reconstruction) -> None:
    assert is_plausible(model)
    camera = next(iter(model.cameras.values()))
    camera.params = np.array([*camera.params[:3], 24.0])
    assert not is_plausible(model)
    assert supported_models([model], 15) == []
