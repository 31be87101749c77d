"""Define an upright pose: translation, yaw about gravity, and scale (paper, section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import yaw_gv


@dataclass(frozen=True)
class UprightPose:
    """Similarity from the object frame to GV; ``base`` is the upright frame at yaw 0.

    A point p goes to ``scale * yaw_gv(yaw) @ base @ p + translation``.
    """

    yaw_rad: float
    translation_gv: Float[np.ndarray, "3"]
    scale: float
    base: Float[np.ndarray, "3 3"]

    @classmethod
    def of(cls, gv_from_object: Float[np.ndarray, "4 4"]) -> UprightPose:
        """Return the pose of a similarity matrix; its rotation becomes ``base``."""
        scale = float(np.cbrt(np.linalg.det(gv_from_object[:3, :3])))
        return cls(0.0, gv_from_object[:3, 3].copy(), scale, gv_from_object[:3, :3] / scale)

    @property
    def rotation_gv(self) -> Float[np.ndarray, "3 3"]:
        """Rotation from the object frame to GV."""
        return yaw_gv(self.yaw_rad) @ self.base

    def apply(self, points_object: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return points in GV."""
        return self.scale * points_object @ self.rotation_gv.T + self.translation_gv

    def rays_to_object(
        self, origins_gv: Float[np.ndarray, "n 3"], directions_gv: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Return rays in the object frame; distances in lengths of the direction are kept."""
        inverse = self.rotation_gv / self.scale
        return (origins_gv - self.translation_gv) @ inverse, directions_gv @ inverse

    def moved(self, step: Float[np.ndarray, "5"]) -> UprightPose:
        """Return the pose after a step (yaw rad, x, y, z metres, log scale)."""
        return UprightPose(
            self.yaw_rad + float(step[0]),
            self.translation_gv + step[1:4],
            self.scale * float(np.exp(step[4])),
            self.base,
        )

    def lowered_to(
        self, height_gv: float, vertices_object: Float[np.ndarray, "v 3"]
    ) -> UprightPose:
        """Return the pose with the lowest vertex at ``height_gv`` (y, down)."""
        lowest = float(self.apply(vertices_object)[:, 1].max())
        return self.moved(np.array([0.0, 0.0, height_gv - lowest, 0.0, 0.0]))
