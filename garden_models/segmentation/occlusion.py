"""Compare masks with the outline of the object's points: what is hidden, what agrees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.scene import PointCloud, View
from garden_models.segmentation.zbuffer import front_points, project_points

WIDEST = 2.0
"""The object's outline is followed this many picture sizes past the picture's border."""


@dataclass(frozen=True)
class Outlined:
    """A view's mask against the outline of the object's points there.

    ``occluded`` is the share (0..1) of the whole outline that is hidden, ``overlap`` the
    intersection over union of the mask and the outline's visible part (NaN: neither).
    """

    occluded: float
    overlap: float


def compare_outline(
    own: PointCloud,
    mask: Bool[np.ndarray, "h w"],
    view: View,
    camera_from_points: Float[np.ndarray, "r 4"],
) -> Outlined:
    """Draw the object's points alone, in a picture wide enough to hold them.

    Hidden is what falls outside of the real picture, or what the mask leaves out, but for
    where the view sees past the object's depth. An object behind the camera is hidden whole.
    """
    width, height = view.size
    seen = project_points(own.xyz, view.K, camera_from_points, view.size)
    ahead = seen.z > 0
    if not ahead.any():
        return Outlined(1.0, 0.0 if mask.any() else float("nan"))
    picture = np.array(view.size)
    low = np.percentile(seen.pixels[ahead], 1, axis=0)
    high = np.percentile(seen.pixels[ahead], 99, axis=0)
    before = np.clip(np.ceil(-low), 0, WIDEST * picture).astype(int)
    after = np.clip(np.ceil(high) - picture, 0, WIDEST * picture).astype(int)
    size = (int(width + before[0] + after[0]), int(height + before[1] + after[1]))
    shifted = view.K.copy()
    shifted[:2, 2] += before
    wide = project_points(own.xyz, shifted, camera_from_points, size)
    front = front_points(own, wide, float(view.K[0, 0]), size, growth=1.5)
    outline = ndimage.binary_closing(np.pad(front.index >= 0, 4), np.ones((3, 3)), 2)[4:-4, 4:-4]
    if not outline.any():
        return Outlined(1.0, 0.0 if mask.any() else float("nan"))
    window = (slice(before[1], before[1] + height), slice(before[0], before[0] + width))
    inside, z = outline[window], front.z[window]
    tolerance = 4 * float(np.median(own.spacing))
    seen_past = (view.depth > 1.01 * z + tolerance) | ~np.isfinite(z)
    covered = inside & ~mask & ~seen_past
    hidden = int(outline.sum() - inside.sum() + covered.sum())
    visible = inside & ~covered
    union = np.count_nonzero(visible | mask)
    overlap = np.count_nonzero(visible & mask) / union if union else float("nan")
    return Outlined(float(np.clip(hidden / outline.sum(), 0, 1)), overlap)
