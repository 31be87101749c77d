"""Set an object down on its support, and make its colliders flat where they stand.

A reconstructed mesh is wrong by its noise, so that its colliders would stand on the few
vertices that stick out most, tilt and creep. Below that noise the shape of the bottom is not
known; what is known is that the object stood still. So the colliders' lowest layer, as thick
as the noise, is made level with the support. Nothing else is helped: no damping, no welding,
and the visible mesh keeps its shape.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.physics.config import MeshNoise
from garden_models.physics.convex_pieces import hull_piece
from garden_models.scene import ConvexPiece


def noise_m(vertices: Float[np.ndarray, "v 3"], noise: MeshNoise) -> float:
    """Return the noise of a mesh (upright, y down) in metres."""
    extent = np.ptp(vertices, axis=0)
    return float(min(noise.of_size * extent.max(), noise.of_height * extent[1]))


def bottom_gv(vertices_gv: Float[np.ndarray, "v 3"], noise: MeshNoise) -> float:
    """Return the y (down) at which a mesh ends below, single spikes left out."""
    y = vertices_gv[:, 1]
    count = min(max(8, int(np.ceil(noise.lowest_share * len(y)))), len(y))
    return float(np.partition(y, len(y) - count)[-count:].mean())


def level_pieces(
    pieces: tuple[ConvexPiece, ...],
    gv_from_body: Float[np.ndarray, "4 4"],
    support_height_gv: float,
    tolerance_m: float,
) -> tuple[ConvexPiece, ...]:
    """Flatten the colliders' lowest layer, as thick as the tolerance, onto the support.

    What a piece is ``tolerance_m`` above the support, it becomes on the support: it is cut
    there, and the cut's outline is moved vertically down onto the support. Pieces that lie
    in that layer or below altogether are dropped, unless all would be.
    """
    body_from_gv = invert_rigid(gv_from_body)
    levelled = []
    for piece in pieces:
        vertices_gv = transform_points(gv_from_body, piece.vertices)
        standing = _standing(vertices_gv, piece.faces, support_height_gv, tolerance_m)
        flat = hull_piece(transform_points(body_from_gv, standing), 0.5 * tolerance_m)
        if flat is not None:
            levelled.append(flat)
    return tuple(levelled) if levelled else pieces


def _standing(
    vertices_gv: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    support_height_gv: float,
    tolerance_m: float,
) -> Float[np.ndarray, "w 3"]:
    """Return the points whose hull is a convex piece with its lowest layer made level."""
    level = support_height_gv - tolerance_m
    low = vertices_gv[:, 1] > level
    if not low.any():
        return vertices_gv
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[low[edges[:, 0]] & ~low[edges[:, 1]]]
    below, above = vertices_gv[edges[:, 0]], vertices_gv[edges[:, 1]]
    share = (level - above[:, 1]) / (below[:, 1] - above[:, 1])
    feet = above + share[:, None] * (below - above)
    feet[:, 1] = support_height_gv
    return np.concatenate([vertices_gv[~low], feet])
