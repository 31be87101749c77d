"""Define a shape: a mesh in the pipeline's object frame and the surfaces it offers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from garden_models.disentanglement.training.shapes.solid import Solid, merged

LONGEST_EDGE = 0.3
"""Metres. Longer edges are halved, so that a crop cuts few triangles."""


@dataclass(frozen=True)
class Shelf:
    """A horizontal rectangle that carries things: metres above the base, x and z range.

    ``clearance`` is the free height above it.
    """

    height: float
    x: tuple[float, float]
    z: tuple[float, float]
    clearance: float = 2.0


@dataclass(frozen=True)
class Shape:
    """A triangle mesh in the object frame: y down, base at y = 0, footprint centred, metres.

    ``name`` identifies the shape in splits; ``family`` is its kind.
    """

    name: str
    family: str
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    shelves: tuple[Shelf, ...] = ()

    @property
    def extent(self) -> Float[np.ndarray, "3"]:
        """Size along the axes, metres."""
        return np.ptp(self.vertices, axis=0)

    @property
    def size(self) -> float:
        """Longest extent, metres."""
        return float(self.extent.max())


@dataclass
class Draft:
    """Parts of a shape as a family builds them: y up, any origin."""

    parts: list[Solid] = field(default_factory=list)
    shelves: list[Shelf] = field(default_factory=list)


Family = Callable[[np.random.Generator], Draft]
"""Builds one member of a family from random parameters."""


def finish(draft: Draft, name: str, family: str) -> Shape:
    """Return a draft as a shape."""
    whole = merged(draft.parts)
    return from_mesh(whole.vertices, whole.faces, name, family, draft.shelves)


def from_mesh(
    vertices_y_up: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    name: str,
    family: str,
    shelves: Sequence[Shelf] = (),
) -> Shape:
    """Return a mesh with y up as a shape: centred, on its base, long edges halved."""
    low, high = vertices_y_up.min(axis=0), vertices_y_up.max(axis=0)
    origin = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    vertices, faces = subdivided(vertices_y_up - origin, faces, LONGEST_EDGE)
    moved = tuple(
        Shelf(
            s.height - origin[1],
            (s.x[0] - origin[0], s.x[1] - origin[0]),
            (-(s.z[1] - origin[2]), -(s.z[0] - origin[2])),
            s.clearance,
        )
        for s in shelves
    )
    # Half a turn about x: y up becomes y down, and faces keep their orientation.
    return Shape(name, family, vertices * np.array([1.0, -1.0, -1.0]), faces, moved)


def subdivided(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], longest: float
) -> tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]:
    """Halve each triangle's longest edge until none is longer than ``longest``.

    Neighbours are not kept together: the mesh is sampled, not rendered.
    """
    done = []
    while len(faces):
        corners = vertices[faces]
        length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = length.max(axis=1) > longest
        done.append(faces[~long])
        split, edge = faces[long], length[long].argmax(axis=1)
        rows = np.arange(len(split))
        a, b, c = (split[rows, (edge + k) % 3] for k in range(3))
        middle = len(vertices) + rows
        vertices = np.concatenate([vertices, (vertices[a] + vertices[b]) / 2])
        faces = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return vertices, np.concatenate(done)
