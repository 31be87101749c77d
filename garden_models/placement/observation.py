"""Pick the views and pixels against which a pose is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from garden_models.geometry.camera import pixel_rays
from garden_models.geometry.rigid import invert_rigid
from garden_models.meshing.object_view import ObjectView, object_views
from garden_models.scene import GravityView, ObjectMasks, Reconstruction

MARGIN = 0.35
"""The compared box reaches beyond the mask's by this share of its sides."""


@dataclass(frozen=True)
class ViewPixels:
    """A regular lattice of pixels of one view.

    ``directions_gv`` have z-depth 1, so ray distances are z-depths. ``outside_px`` is the
    signed distance to the mask's outline (negative inside), ``outward_px`` its gradient;
    ``occluder_depth`` is the depth of what is seen outside the mask (infinite: nothing).
    """

    shape: tuple[int, int]
    stride: int
    focal_px: float
    gv_from_camera: Float[np.ndarray, "4 4"]
    directions_gv: Float[np.ndarray, "n 3"]
    mask: Bool[np.ndarray, " n"]
    depth: Float[np.ndarray, " n"]
    occluder_depth: Float[np.ndarray, " n"]
    outside_px: Float[np.ndarray, " n"]
    outward_px: Float[np.ndarray, "n 2"]
    rgb: UInt8[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Observation:
    """The compared pixels of all picked views, and the same concatenated for ray casting."""

    views: tuple[ViewPixels, ...]
    origins_gv: Float[np.ndarray, "m 3"]
    directions_gv: Float[np.ndarray, "m 3"]
    view_start: Int[np.ndarray, " views_plus_1"]

    @classmethod
    def of(cls, views: Sequence[ViewPixels]) -> Observation:
        """Concatenate the views."""
        counts = [len(view.depth) for view in views]
        origins = [np.tile(v.gv_from_camera[:3, 3], (len(v.depth), 1)) for v in views]
        return cls(
            tuple(views),
            np.concatenate(origins),
            np.concatenate([v.directions_gv for v in views]),
            np.concatenate([[0], np.cumsum(counts)]),
        )


def observe(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    max_views: int,
    pixels_per_view: int,
) -> Observation | None:
    """Return the pixels to compare, or None if no view sees the object."""
    views = object_views(reconstruction, gravity_view, masks)
    if not views:
        return None
    picked = _spread(views, masks, max_views)
    return Observation.of(
        [_pixels(view, reconstruction.views[view.index].rgb, pixels_per_view) for view in picked]
    )


def _spread(views: Sequence[ObjectView], masks: ObjectMasks, max_views: int) -> list[ObjectView]:
    """Pick views that see much of the object from directions far apart, best first."""
    middle = np.median(masks.points_gv.xyz, axis=0)
    direction = np.stack([view.centre_gv - middle for view in views])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    area = np.array([view.mask.sum() for view in views], float)
    quality = np.sqrt(area / area.max()) * (1.0 - masks.occluded[[v.index for v in views]])
    quality = np.maximum(quality, 1e-3)
    picked = [int(quality.argmax())]
    while len(picked) < min(max_views, len(views)):
        apart = np.arccos(np.clip(direction @ direction[picked].T, -1, 1)).min(axis=1)
        merit = apart * quality
        merit[picked] = -1.0
        picked.append(int(merit.argmax()))
    return [views[i] for i in picked]


def _pixels(view: ObjectView, rgb: UInt8[np.ndarray, "h w 3"], count: int) -> ViewPixels:
    height, width = view.mask.shape
    rows, columns = np.nonzero(view.mask)
    grow_y = int(np.ceil(MARGIN * (np.ptp(rows) + 1)))
    grow_x = int(np.ceil(MARGIN * (np.ptp(columns) + 1)))
    top, bottom = max(rows.min() - grow_y, 0), min(rows.max() + grow_y, height - 1)
    left, right = max(columns.min() - grow_x, 0), min(columns.max() + grow_x, width - 1)
    area = (bottom - top + 1) * (right - left + 1)
    stride = max(1, int(np.floor(np.sqrt(area / count))))
    lattice = np.meshgrid(
        np.arange(top, bottom + 1, stride), np.arange(left, right + 1, stride), indexing="ij"
    )
    shape = (lattice[0].shape[0], lattice[0].shape[1])
    row, column = lattice[0].ravel(), lattice[1].ravel()
    smooth = cv2.GaussianBlur(view.outside_px, (0, 0), 1.0)
    outward = np.stack([np.gradient(smooth, axis=1), np.gradient(smooth, axis=0)], axis=-1)
    gv_from_camera = invert_rigid(view.camera_from_gv)
    rays = pixel_rays(np.stack([column + 0.5, row + 0.5], axis=1), view.K)
    return ViewPixels(
        shape=shape,
        stride=stride,
        focal_px=view.focal_px,
        gv_from_camera=gv_from_camera,
        directions_gv=rays @ gv_from_camera[:3, :3].T,
        mask=view.mask[row, column],
        depth=view.depth[row, column].astype(float),
        occluder_depth=np.where(view.unknown[row, column], 0.0, view.occluder_depth[row, column]),
        outside_px=view.outside_px[row, column].astype(float),
        outward_px=outward[row, column].astype(float),
        rgb=rgb[row, column],
    )
