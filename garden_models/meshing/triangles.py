"""Define the plain triangle surface that meshing works on, and its measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class TriangleSurface:
    """Vertices (v, 3) and counter-clockwise (seen from outside) faces (f, 3)."""

    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]


def signed_volume(surface: TriangleSurface) -> float:
    """Return the enclosed volume, positive if the faces look outward."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0)


def flipped(surface: TriangleSurface) -> TriangleSurface:
    """Return the surface with all faces turned around."""
    return TriangleSurface(surface.vertices, surface.faces[:, ::-1])


def vertex_normals(surface: TriangleSurface) -> Float[np.ndarray, "v 3"]:
    """Return unit outward normals, faces weighted by area."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    of_face = np.cross(b - a, c - a)
    normals = np.zeros_like(surface.vertices)
    for corner in range(3):
        np.add.at(normals, surface.faces[:, corner], of_face)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)


def face_areas(surface: TriangleSurface) -> Float[np.ndarray, " f"]:
    """Return the area of every face."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
