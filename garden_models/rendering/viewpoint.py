"""Choose from where a person looks at a scene: upright, from a photo's side, near enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import normalized
from garden_models.rendering.turntable import look_at, viewer_direction

FIELD_OF_VIEW_DEG = 50.0
"""Vertical field of view."""


@dataclass(frozen=True)
class Viewpoint:
    """Where a viewer stands in GV (y down) and looks: at ``centre``, from ``distance`` away.

    ``yaw_deg`` 0 looks along +z, 90 along +x; ``elevation_deg`` is how far the viewer is
    above the centre's level.
    """

    centre: Float[np.ndarray, "3"]
    yaw_deg: float
    elevation_deg: float
    distance: float

    @property
    def camera_from_gv(self) -> Float[np.ndarray, "3 4"]:
        """The upright camera there."""
        away = viewer_direction(self.yaw_deg, self.elevation_deg)
        return look_at(self.centre + self.distance * away, self.centre)

    def from_above(self) -> Viewpoint:
        """Return the view straight down on the same centre, turned the same way."""
        return replace(self, elevation_deg=89.9)


def viewpoint_towards(
    centre: Float[np.ndarray, "3"],
    radius: float,
    eye: Float[np.ndarray, "3"],
    share: float,
    elevations_deg: tuple[float, float] = (8.0, 65.0),
) -> Viewpoint:
    """Return the view from the side of ``eye`` in which a sphere fills ``share`` of the height.

    The viewer stands no farther away than ``eye`` (a photo's camera: what is nearer to it
    hides nothing), but always outside of the sphere.
    """
    away = eye - centre
    far = float(np.linalg.norm(away))
    direction = normalized(away) if far > 1e-9 else np.array([0.0, 0.0, -1.0])
    elevation = np.degrees(np.arcsin(np.clip(-direction[1], -1, 1)))
    wished = radius / (share * np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2))
    return Viewpoint(
        centre,
        float(np.degrees(np.arctan2(-direction[0], -direction[2]))),
        float(np.clip(elevation, *elevations_deg)),
        float(max(min(wished, far), 1.5 * radius)),
    )


def bounding_sphere(clouds: Sequence[Float[np.ndarray, "n 3"]]) -> tuple[np.ndarray, float]:
    """Return centre and radius of the sphere around the box of all points."""
    points = np.concatenate(list(clouds))
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low)) / 2


def intrinsics(size: tuple[int, int]) -> Float[np.ndarray, "3 3"]:
    """Return K of a picture (width, height) with the viewer's field of view."""
    width, height = size
    focal = height / 2 / np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2)
    return np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
