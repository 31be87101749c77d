"""Move cameras, depths and Gaussians by a similarity."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import quaternion_from_matrix
from garden_models.reconstruction.geometry_model import Gaussians, GeometryView


@dataclass(frozen=True)
class Similarity:
    """``x_b = scale * rotation @ x_a + translation``: frame b from frame a."""

    scale: float
    rotation: Float[np.ndarray, "3 3"]
    translation: Float[np.ndarray, "3"]

    def points(self, points_a: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Return points in frame b."""
        return self.scale * points_a @ self.rotation.T + self.translation

    def camera(self, camera_from_a: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "3 4"]:
        """Return ``camera_from_b``; camera coordinates are in the unit of b too."""
        rotation = camera_from_a[:3, :3] @ self.rotation.T
        shift = self.scale * camera_from_a[:3, 3] - rotation @ self.translation
        return np.column_stack([rotation, shift])

    def view(self, view: GeometryView) -> GeometryView:
        """Return a view of world a as one of world b."""
        return replace(
            view,
            depth=view.depth * np.float32(self.scale),
            camera_from_world=self.camera(view.camera_from_world),
        )

    def gaussians(self, gaussians: Gaussians) -> Gaussians:
        """Return Gaussians in frame b."""
        return replace(
            gaussians,
            mean=self.points(gaussians.mean).astype(np.float32),
            scale=(gaussians.scale * self.scale).astype(np.float32),
            rotation=turned(self.rotation, gaussians.rotation).astype(np.float32),
        )

    def after(self, first: Similarity) -> Similarity:
        """Return this similarity applied after another."""
        return Similarity(
            self.scale * first.scale,
            self.rotation @ first.rotation,
            self.points(first.translation),
        )

    def inverse(self) -> Similarity:
        """Return frame a from frame b."""
        rotation = self.rotation.T
        return Similarity(1 / self.scale, rotation, -rotation @ self.translation / self.scale)


IDENTITY = Similarity(1.0, np.eye(3), np.zeros(3))


def from_camera(
    camera_from_a: Float[np.ndarray, "r 4"], camera_from_b: Float[np.ndarray, "r 4"], factor: float
) -> Similarity:
    """Return world b from world a of one camera; a's unit is ``factor`` of b's."""
    rotation = camera_from_b[:3, :3].T @ camera_from_a[:3, :3]
    shift = camera_from_b[:3, :3].T @ (factor * camera_from_a[:3, 3] - camera_from_b[:3, 3])
    return Similarity(factor, rotation, shift)


def turned(
    rotation: Float[np.ndarray, "3 3"], wxyz: Float[np.ndarray, "n 4"]
) -> Float[np.ndarray, "n 4"]:
    """Return quaternions after another rotation (a product from the left), w >= 0."""
    a = quaternion_from_matrix(rotation)
    w, x, y, z = wxyz.T.astype(np.float64)
    product = np.stack(
        [
            a[0] * w - a[1] * x - a[2] * y - a[3] * z,
            a[0] * x + a[1] * w + a[2] * z - a[3] * y,
            a[0] * y - a[1] * z + a[2] * w + a[3] * x,
            a[0] * z + a[1] * y - a[2] * x + a[3] * w,
        ],
        axis=1,
    )
    return np.where(product[:, :1] < 0, -product, product)
