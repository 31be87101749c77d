"""Choose the view from which a model is asked to complete an object, and prepare it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.meshing.mesh_model import MeshRequest
from garden_models.scene import BadGeometry, ObjectMasks, Reconstruction, View

FLYING = 0.04
"""A pixel whose neighbours' depths span more than this share of it hangs between surfaces."""

NEIGHBOURHOOD = 3
"""Pixels across."""


def best_view(reconstruction: Reconstruction, masks: ObjectMasks) -> int:
    """Return the view with the largest mask, as far as it has depth and nothing hides it.

    Raises BadGeometry if no view has a masked pixel with depth.
    """
    measured = np.array(
        [
            float(np.count_nonzero(mask & (view.depth > 0)))
            for view, mask in zip(reconstruction.views, masks.masks, strict=True)
        ]
    )
    # What is hidden can only be guessed: it costs more than its share of the pixels.
    merit = measured * (1.0 - np.asarray(masks.occluded, float)) ** 2
    if not merit.max(initial=0.0) > 0:
        raise BadGeometry(
            f"no photo shows {masks.target.name!r} with depth, so nothing can complete it; "
            "photograph it from more sides or draw its box again"
        )
    return int(merit.argmax())


def mesh_request(view: View, mask: Bool[np.ndarray, "h w"], seed: int) -> MeshRequest:
    """Return what a model is asked: the photo, the mask and each pixel's point."""
    return MeshRequest(view.rgb, mask, point_map(view), seed)


def point_map(view: View) -> Float[np.ndarray, "h w 3"]:
    """Return each pixel's point in the OpenCV camera (metres), NaN where there is no depth.

    Flying pixels, which hang between two surfaces at an outline, have none either.
    """
    height, width = view.depth.shape
    rays = pixel_rays(pixel_grid(height, width), view.K)
    known = (view.depth > 0) & ~flying_pixels(view.depth)
    points: Float[np.ndarray, "h w 3"] = np.where(
        known[..., None], rays * view.depth[..., None], np.nan
    ).astype(np.float32)
    return points


def flying_pixels(depth: Float[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Mark pixels with a jump of depth among their neighbours (0: no depth, no jump)."""
    valid = depth > 0
    nearest = ndimage.minimum_filter(np.where(valid, depth, np.inf), NEIGHBOURHOOD)
    farthest = ndimage.maximum_filter(np.where(valid, depth, -np.inf), NEIGHBOURHOOD)
    return valid & (farthest - nearest > FLYING * np.where(valid, depth, 1.0))
