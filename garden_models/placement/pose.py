"""Define a pose that turns about gravity: translation, yaw, and scale (paper, section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import yaw_gv
from garden_models.geometry.upright import nearest_yaw, tilt_deg

UPRIGHT_DEG = 1e-4
"""What leans less is upright but for rounding."""


@dataclass(frozen=True)
class UprightPose:
    """Similarity from the object frame to GV; ``base`` is the rotation at yaw 0.

    It is upright unless ``base`` leans, as a foreign model's pose may. A point p goes to
    ``scale * yaw_gv(yaw) @ base @ p + translation``.
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

    @property
    def tilt_deg(self) -> float:
        """How far the object leans."""
        return tilt_deg(self.rotation_gv)

    def made_upright(self, vertices_object: Float[np.ndarray, "v 3"]) -> UprightPose:
        """Return the pose with the nearest upright rotation, turned about the mesh's middle."""
        if self.tilt_deg < UPRIGHT_DEG:
            return self
        base = yaw_gv(nearest_yaw(self.rotation_gv))
        middle = 0.5 * (vertices_object.min(axis=0) + vertices_object.max(axis=0))
        there = self.apply(middle[None])[0]
        return UprightPose(0.0, there - self.scale * base @ middle, self.scale, base)

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
