"""SIFT features: exact places, ranked prefixes, small and empty photos."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from garden_models.reconstruction.registration_features import (
    DESCRIPTOR_UNIT,
    Features,
    detect_affine_features,
    detect_features,
    root_sift,
)

from .textured_room import noise_texture

Detector = Callable[[np.ndarray, int], Features]


def blobs(width: int, height: int, centres: np.ndarray, sigma: float) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width] + 0.5
    grey = np.full((height, width), 60.0)
    for cx, cy in centres:
        grey += 150 * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2))
    return np.repeat(grey.clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize("width", [600, 1200])
@pytest.mark.parametrize("detect", [detect_features, detect_affine_features])
def test_blobs_are_found_at_their_centres(detect: Detector, width: int) -> None:
    """Pixel centres are at +0.5, in doubled small photos too."""
    centres = np.array([[100.3, 80.7], [300.0, 200.5], [450.6, 120.2]])
    found = detect(blobs(width, 300, centres, 5.0), 100).keypoints
    for centre in centres:
        assert np.linalg.norm(found[:, :2] - centre, axis=1).min() < 0.1


def test_fewer_features_are_a_prefix_of_more() -> None:
    rgb = noise_texture(3, 512)
    many, few = detect_features(rgb, 800), detect_features(rgb, 200)
    assert len(few) == 200 and len(many) == 800
    assert np.array_equal(few.keypoints, many.first(200).keypoints)
    assert np.array_equal(few.descriptors, many.first(200).descriptors)
    assert (np.diff(many.keypoints[:, 2]) <= 0).all()


@pytest.mark.parametrize("detect", [detect_features, detect_affine_features])
def test_a_flat_photo_has_no_features(detect: Detector) -> None:
    assert len(detect(np.full((100, 120, 3), 90, np.uint8), 50)) == 0


def test_descriptors_have_the_stated_length() -> None:
    descriptors = np.random.default_rng(0).random((20, 128)).astype(np.float32)
    length = np.linalg.norm(root_sift(descriptors).astype(float), axis=1)
    assert np.allclose(length, DESCRIPTOR_UNIT, rtol=0.01)
