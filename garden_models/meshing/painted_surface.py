"""Look up the colours of a model's mesh at places near its surface."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, UInt8
from scipy.spatial import cKDTree

from garden_models.meshing.colour import VertexColours
from garden_models.meshing.ray_casting import RayCaster
from garden_models.meshing.texture_sampling import sample_texture

REACH = 0.03
"""Colours are looked for this share of the size along the normal, then at the nearest vertex."""

LIFT = 1e-3
"""Rays start this share of the size off the surface, so that they do not miss it."""


class PaintedSurface:
    """A mesh with a texture or colours at its vertices."""

    def __init__(
        self,
        vertices: Float[np.ndarray, "v 3"],
        faces: Int[np.ndarray, "f 3"],
        vertex_rgb: UInt8[np.ndarray, "v 3"],
        uv: Float[np.ndarray, "v 2"] | None = None,
        texture: UInt8[np.ndarray, "h w 3"] | None = None,
    ) -> None:
        """``texture`` with ``uv`` (origin at the lower left) goes before ``vertex_rgb``."""
        self._faces = faces
        self._rgb = vertex_rgb
        self._uv, self._texture = uv, texture
        self._size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        self._caster = RayCaster(vertices, faces)
        self._tree = cKDTree(vertices)

    def sample(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
    ) -> VertexColours:
        """Return the colours of the nearest places along the normals; all have one."""
        lift, best = LIFT * self._size, np.full(len(points), REACH * self._size)
        face = np.full(len(points), -1)
        weights = np.zeros((len(points), 3))
        for side in (1.0, -1.0):
            hits = self._caster.cast(points + side * lift * normals, -side * normals)
            away = np.abs(hits.distance - lift)
            nearer = (hits.face >= 0) & (away < best)
            best[nearer], face[nearer] = away[nearer], hits.face[nearer]
            weights[nearer] = hits.barycentric[nearer]
        corners = self._faces[np.maximum(face, 0)]
        missed = np.flatnonzero(face < 0)
        if len(missed):
            corners[missed] = self._tree.query(points[missed])[1][:, None]
            weights[missed] = [1.0, 0.0, 0.0]
        everywhere = np.ones(len(points), bool)
        return VertexColours(self._blend(corners, weights), everywhere, everywhere)

    def _blend(
        self, corners: Int[np.ndarray, "n 3"], weights: Float[np.ndarray, "n 3"]
    ) -> Float[np.ndarray, "n 3"]:
        if self._uv is not None and self._texture is not None:
            uv = np.einsum("nc,ncd->nd", weights, self._uv[corners])
            return sample_texture(self._texture, uv).astype(np.float32)
        blended = np.einsum("nc,ncd->nd", weights, self._rgb[corners].astype(float))
        return blended.astype(np.float32)
