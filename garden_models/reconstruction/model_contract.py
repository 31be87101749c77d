"""Check what a geometry model is asked and what it answers."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.reconstruction.geometry_model import GeometryRequest
from garden_models.scene import BadGeometry, BadInput

MAX_SKEW = 0.05
"""How far a predicted rotation may be from a proper one (largest entry)."""


def check_request(request: GeometryRequest, model: str, extras: bool = False) -> None:
    """Raise BadInput for a request that no such model can answer.

    Only a model with ``extras`` is asked for camera tokens or Gaussians.
    """
    if not request.photos:
        raise BadInput("no photos to predict geometry from")
    if (request.K is None) != (request.camera_from_world is None):
        raise BadInput("give intrinsics and poses of the cameras together, or neither")
    for name, given in (("K", request.K), ("camera_from_world", request.camera_from_world)):
        if given is not None and len(given) != len(request.photos):
            raise BadInput(f"{len(given)} of {name} for {len(request.photos)} photos")
    if (request.want_tokens or request.want_gaussians) and not extras:
        raise BadInput(
            f"{model} predicts neither camera tokens nor Gaussians: use depth_anything_3, or ask "
            "for none (geometry.gaussians and geometry.camera_tokens = false)"
        )


def check_finite(array: np.ndarray, what: str) -> np.ndarray:
    """Return the array; raise BadGeometry if a number in it is not finite."""
    if not np.isfinite(array).all():
        raise BadGeometry(
            f"the model answered with {what} that are not finite numbers: its weights are "
            "damaged, or half precision overflows on this device"
        )
    return array


def proper_camera(camera_from_world: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "3 4"]:
    """Return a camera whose rotation is exact (float64); raise BadGeometry if it is none."""
    matrix = np.asarray(camera_from_world, np.float64)
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    rotation = u @ vt
    if np.linalg.det(rotation) < 0 or np.abs(rotation - matrix[:3, :3]).max() > MAX_SKEW:
        raise BadGeometry("the model answered with a camera whose rotation is none")
    return np.column_stack([rotation, matrix[:3, 3]])
