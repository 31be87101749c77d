"""Baseline: GeoCalib's gravity in each photo, averaged or agreed on."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.photo_gravity.photo_gravity import PhotoGravityRequest, ReadPhotoGravity
from garden_models.scene import GravityEvidence, Reconstruction

Directions = Float[np.ndarray, "n 3"]

AGREE = np.radians(5.0)
LEAST_SIGMA = np.radians(0.2)


def per_view(
    reconstruction: Reconstruction, predict: ReadPhotoGravity
) -> tuple[Directions, Float[np.ndarray, " n"]]:
    """Return the direction down that each photo gives, in the world, and the sigmas (radians)."""
    views = reconstruction.views
    focal = np.array([view.K[0, 0] for view in views], dtype=np.float64)
    found = predict(PhotoGravityRequest(tuple(view.rgb for view in views), focal))
    downs = [
        view.camera_from_world[:3, :3].T @ down
        for view, down in zip(views, found.down_camera, strict=True)
    ]
    return np.array(downs).reshape(-1, 3), np.maximum(found.sigma_rad, LEAST_SIGMA)


def mean_direction(downs: Directions, weights: Float[np.ndarray, " n"]) -> np.ndarray:
    """Return the weighted mean direction."""
    mean = weights @ downs
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))


def agreed_direction(downs: Directions, weights: Float[np.ndarray, " n"]) -> np.ndarray:
    """Return the mean of the heaviest set of directions within ``AGREE`` of one of them."""
    near = downs @ downs.T > np.cos(AGREE)
    best = near[int(np.argmax(near @ weights))]
    return mean_direction(downs[best], weights[best])


def estimate(
    reconstruction: Reconstruction, predict: ReadPhotoGravity, consensus: bool
) -> GravityEvidence | None:
    """Return the mean of all photos, or with ``consensus`` of those that agree."""
    if not reconstruction.views:
        return None
    downs, sigmas = per_view(reconstruction, predict)
    combine = agreed_direction if consensus else mean_direction
    down = combine(downs, 1 / sigmas**2)
    sigma = float(np.degrees(np.sqrt(1 / np.sum(1 / sigmas**2))))
    name = "geocalib_ransac" if consensus else "geocalib"
    return GravityEvidence(name, down, sigma, True, f"{len(downs)} photos")
