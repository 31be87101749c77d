"""Ask every photo whether a point is the object, something else, or nothing at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.disentanglement.protocol import ViewEvidence
from garden_models.geometry.camera import inside_image, project
from garden_models.scene import PointCloud


@dataclass(frozen=True)
class Votes:
    """Per point, the number of photos (fractions at soft borders) in which it is ...

    ``on_object``: visible, on a pixel of the object's mask; ``off_object``: visible, on
    another pixel; ``seen_through``: in front of what the photo shows, so it is not there.
    """

    on_object: Float[np.ndarray, " n"]
    off_object: Float[np.ndarray, " n"]
    seen_through: Float[np.ndarray, " n"]

    @property
    def visible(self) -> Float[np.ndarray, " n"]:
        """Number of photos that see the point itself."""
        return self.on_object + self.off_object


def mask_votes(
    points_gv: PointCloud, views: tuple[ViewEvidence, ...], depth_tolerance: float
) -> Votes:
    """Count votes over the photos.

    A point is visible where it is no farther from the depth map than its own spacing or
    ``depth_tolerance`` (relative to the depth); behind it, it is hidden and does not count.
    """
    votes = np.zeros((3, len(points_gv)))
    for view in views:
        height, width = view.depth.shape
        pixels, z = project(points_gv.xyz, view.K, view.camera_from_gv)
        inside = np.flatnonzero(inside_image(pixels, (width, height)))
        column, row = pixels[inside].astype(np.int64).T
        depth = view.depth[row, column]
        slack = np.maximum(2 * points_gv.spacing[inside], depth_tolerance * z[inside])
        known = depth > 0
        off = z[inside] - depth
        visible = known & (np.abs(off) <= slack)
        on_object = view.mask[row, column]
        votes[0, inside] += visible & on_object
        votes[1, inside] += visible & ~on_object
        votes[2, inside] += known & (off < -slack)
    return Votes(*votes)
