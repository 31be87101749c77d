"""Baseline: GeoCalib's gravity in each photo, averaged or agreed on (needs its weights).

``geocalib`` is not among this program's dependencies: the user installs it from its
repository. Its ``gravity.vec3d`` is the direction UP in the OpenCV camera.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from garden_models.scene import BadInput, GravityEvidence, Reconstruction

Directions = Float[np.ndarray, "n 3"]
Calibrate = Callable[[UInt8[np.ndarray, "h w 3"], float], tuple[np.ndarray, float]]
"""From a photo and its focal length (pixels) to up in the camera and its sigma in radians."""

AGREE = np.radians(5.0)
LEAST_SIGMA = np.radians(0.2)


def load_geocalib(weights: Path) -> Calibrate:
    """Return GeoCalib with local pinhole weights.

    Raises BadInput if the file or the package is not there.
    """
    if not weights.is_file():
        raise BadInput(f"no such GeoCalib weights: {weights}")
    try:
        package = importlib.import_module("geocalib")
    except ImportError as error:
        raise BadInput(
            "GeoCalib is not installed: install it from its repository cvg/GeoCalib to compare "
            "with it, or leave out --geocalib"
        ) from error
    import torch

    model = package.GeoCalib(weights=str(weights)).eval()

    def calibrate(rgb: np.ndarray, focal: float) -> tuple[np.ndarray, float]:
        image = torch.from_numpy(np.ascontiguousarray(rgb)).permute(2, 0, 1).float() / 255
        with torch.inference_mode():
            # One element: the priors of several are mistaken for a truth value.
            found = model.calibrate(
                image, camera_model="pinhole", priors={"focal": torch.tensor(float(focal))}
            )
        up = found["gravity"].vec3d.reshape(-1, 3)[0].cpu().numpy().astype(np.float64)
        sigma = float(torch.as_tensor(found["gravity_uncertainty"]).reshape(-1)[0])
        return up, sigma

    return calibrate


def per_view(
    reconstruction: Reconstruction, calibrate: Calibrate
) -> tuple[Directions, Float[np.ndarray, " n"]]:
    """Return the direction down that each photo gives, in the world, and the sigmas (radians)."""
    downs, sigmas = [], []
    for view in reconstruction.views:
        up, sigma = calibrate(view.rgb, float(view.K[0, 0]))
        downs.append(view.camera_from_world[:3, :3].T @ (-up / np.linalg.norm(up)))
        sigmas.append(max(sigma, LEAST_SIGMA))
    return np.array(downs).reshape(-1, 3), np.array(sigmas)


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
    reconstruction: Reconstruction, calibrate: Calibrate, consensus: bool
) -> GravityEvidence | None:
    """Return the mean of all photos, or with ``consensus`` of those that agree."""
    if not reconstruction.views:
        return None
    downs, sigmas = per_view(reconstruction, calibrate)
    combine = agreed_direction if consensus else mean_direction
    down = combine(downs, 1 / sigmas**2)
    sigma = float(np.degrees(np.sqrt(1 / np.sum(1 / sigmas**2))))
    name = "geocalib_ransac" if consensus else "geocalib"
    return GravityEvidence(name, down, sigma, True, f"{len(downs)} photos")
