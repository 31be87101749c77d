"""Tell which points a view shows, by its depth and, where it has none, by the points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.scene import PointCloud, View
from garden_models.segmentation.zbuffer import Projection, front_points, project_points

BEHIND = 4.0
"""A point this many spacings behind what its pixel shows is hidden."""


@dataclass(frozen=True)
class Sight:
    """How a view sees points: where they project, which of them it shows, and for all in the
    picture the z-depth of what their pixel shows (infinite: unknown).
    """

    camera_from_points: Float[np.ndarray, "4 4"]
    projection: Projection
    visible: Bool[np.ndarray, " n"]
    seen_z: Float[np.ndarray, " n"]

    def inside(self, mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, " n"]:
        """Tell which points the view shows inside a mask of its own size."""
        out = self.visible.copy()
        out[out] = mask.ravel()[self.projection.flat[out]]
        return out

    def hidden_share(self, own: Bool[np.ndarray, " n"], points: PointCloud) -> float:
        """Return the share of an object's ``own`` points that something else hides.

        What lies before its points by less than the object's size may be its other side.
        """
        if not own.any():
            return 0.0
        low, high = np.percentile(points.xyz[own], [2, 98], axis=0)
        size = float(np.linalg.norm(high - low)) + BEHIND * float(np.median(points.spacing))
        return float(np.mean(self.seen_z[own] < self.projection.z[own] - size))


def sight(points: PointCloud, view: View, camera_from_points: Float[np.ndarray, "4 4"]) -> Sight:
    """Return how a view sees points."""
    seen = project_points(points.xyz, view.K, camera_from_points, view.size)
    front = front_points(points, seen, float(view.K[0, 0]), view.size)
    near = ndimage.minimum_filter(front.z, 3)
    nearest = np.where(view.depth > 0, view.depth, near).ravel()
    inside = seen.flat >= 0
    seen_z = np.full(len(points), np.inf)
    seen_z[inside] = nearest[seen.flat[inside]]
    visible = inside & (seen.z <= seen_z + BEHIND * points.spacing)
    return Sight(camera_from_points, seen, visible, seen_z)
