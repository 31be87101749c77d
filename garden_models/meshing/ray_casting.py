"""Cast rays at a triangle mesh (Embree): nearest hits and visibility."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class Hits:
    """Nearest hits: ``face`` is -1 and ``distance`` infinite where a ray misses.

    ``distance`` is in lengths of the ray's direction. ``barycentric`` weighs the face's
    three corners.
    """

    face: Int[np.ndarray, " n"]
    distance: Float[np.ndarray, " n"]
    barycentric: Float[np.ndarray, "n 3"]


class RayCaster:
    """A mesh prepared for ray queries, in the mesh's own frame."""

    def __init__(self, vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> None:
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(
            self._scene, np.ascontiguousarray(vertices[faces], dtype=np.float32)
        )

    def cast(self, origins: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> Hits:
        """Return the nearest hit of every ray."""
        found = self._scene.run(_floats(origins), _floats(directions), output=1)
        face = found["primID"].astype(np.int64)
        hit = face >= 0
        u = np.where(hit, found["u"], 0.0)
        v = np.where(hit, found["v"], 0.0)
        distance = np.where(hit, found["tfar"], np.inf)
        return Hits(face, distance, np.stack([1.0 - u - v, u, v], axis=1))

    def blocked(
        self, origins: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> Bool[np.ndarray, " n"]:
        """Tell which rays hit anything."""
        return self._scene.run(_floats(origins), _floats(directions), query="OCCLUDED") == 0


def _floats(values: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    return np.ascontiguousarray(values, dtype=np.float32)
