"""Rasterise triangle meshes with an exact z-buffer on the CPU.

Homogeneous rasterisation (Olano and Greer 1997): for a triangle with camera-frame corners
``v0, v1, v2`` the vector ``b = inverse([v0 v1 v2]) @ ray`` is affine in the pixel position;
``b >= 0`` means that the ray ``(x, y, 1)`` hits it, ``1 / sum(b)`` is the z-depth and
``b / sum(b)`` the perspective-correct barycentric coordinates. No triangle has to be clipped:
the near plane is one more affine inequality. Every inequality bounds a row of pixels by an
interval, so only covered pixels are ever visited. Edges shared by two triangles are evaluated
from the same cross product, so no pixel falls through between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int, Int32

from garden_models.rendering.pixel_ranges import expand_ranges

PIXELS_AT_ONCE = 1 << 21
"""Upper bound of the candidate pixels (bounding boxes) held in memory at a time."""

DEGENERATE = 1e-14
"""Volume of (corner, corner, corner) relative to its lengths below which a triangle is edge-on."""


@dataclass(frozen=True)
class MeshRaster:
    """What each pixel sees of a mesh.

    ``depth`` is z-depth in the mesh's unit, 0 where no triangle is seen (as everywhere in
    GARDEN). ``face_index`` is -1 there. ``barycentric`` are perspective-correct weights of
    the face's three corners (they sum to 1; all 0 where no triangle is seen).
    """

    depth: Float32[np.ndarray, "h w"]
    face_index: Int32[np.ndarray, "h w"]
    barycentric: Float32[np.ndarray, "h w 3"]


def rasterise_mesh(
    vertices_camera: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
    near: float = 1e-3,
) -> MeshRaster:
    """Return depth, face and barycentric coordinates seen through every pixel centre.

    Vertices are in the camera frame (OpenCV), ``K`` in pixels with centres at +0.5, ``size``
    is (width, height), ``near`` the least visible z-depth in the unit of the vertices. Both
    sides of a triangle are drawn. Raises ValueError for a face index out of range.
    """
    width, height = size
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices_camera)):
        raise ValueError(
            f"faces refer to vertices {faces.min()}..{faces.max()}, "
            f"but the mesh has {len(vertices_camera)} vertices"
        )
    nearest = np.full(height * width, np.iinfo(np.int64).max, np.int64)
    if len(faces):
        corners = np.asarray(vertices_camera, np.float64)[faces]
        visible, bounds = _pixel_bounds(corners, K, size, near)
        plane = _ray_planes(corners[visible], K)
        usable = np.isfinite(plane).all(axis=(1, 2))
        visible, plane, bounds = visible[usable], plane[usable], bounds[usable]
        for part in _chunks(bounds):
            pixels, owner, inverse_depth = _covered(plane[part], bounds[part], width, near)
            # Positive floats order like their bits: one integer minimum keeps the nearest
            # face of each pixel, and the lower face index where depths are equal.
            bits = (1.0 / inverse_depth).astype(np.float32).view(np.int32).astype(np.int64)
            np.minimum.at(nearest, pixels, (bits << 32) | visible[part][owner])
    return _resolve(nearest, vertices_camera, faces, K, size)


def interpolate(
    raster: MeshRaster,
    faces: Int[np.ndarray, "f 3"],
    vertex_values: Float[np.ndarray, "v c"] | Int[np.ndarray, "v c"],
) -> Float32[np.ndarray, "h w c"]:
    """Return per-pixel values interpolated from the vertices; 0 where no face is seen."""
    out = np.zeros((*raster.depth.shape, vertex_values.shape[1]), np.float32)
    seen = raster.face_index >= 0
    corner_values = np.asarray(vertex_values, np.float32)[faces[raster.face_index[seen]]]
    out[seen] = np.einsum("pk,pkc->pc", raster.barycentric[seen], corner_values)
    return out


def _pixel_bounds(
    corners: Float[np.ndarray, "f 3 3"],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
    near: float,
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, "m 4"]]:
    """Return faces that may be seen and their pixel ranges (x0, x1, y0, y1), ends included.

    A face that crosses the near plane may reach any pixel; its range is the whole picture.
    """
    width, height = size
    z = corners[..., 2]
    in_front = (z >= near).all(axis=1)
    reaching = (z >= near).any(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = np.einsum("fck,jk->fcj", corners / z[..., None], K[:2])
        low, high = pixels.min(axis=1), pixels.max(axis=1)
    bounds = np.empty((len(corners), 4), np.int64)
    bounds[:] = (0, width - 1, 0, height - 1)
    limit = np.array([width, height], float)
    with np.errstate(invalid="ignore"):
        first = np.ceil(np.clip(low[in_front], 0.0, limit) - 0.5).astype(np.int64)
        last = np.floor(np.clip(high[in_front], 0.0, limit) - 0.5).astype(np.int64)
    bounds[in_front, 0], bounds[in_front, 2] = first.T
    bounds[in_front, 1], bounds[in_front, 3] = np.minimum(last, [width - 1, height - 1]).T
    seen = reaching & (bounds[:, 0] <= bounds[:, 1]) & (bounds[:, 2] <= bounds[:, 3])
    visible = np.flatnonzero(seen)
    return visible, bounds[visible]


def _ray_planes(
    corners: Float[np.ndarray, "f 3 3"], K: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "f 3 3"]:
    """Return rows ``(a, b, c)`` with ``b_i = a x + b y + c`` in pixels; NaN if edge-on."""
    v0, v1, v2 = corners[:, 0], corners[:, 1], corners[:, 2]
    adjugate = np.stack([np.cross(v1, v2), np.cross(v2, v0), np.cross(v0, v1)], axis=1)
    volume = np.einsum("fk,fk->f", v0, adjugate[:, 0])
    lengths = np.prod(np.linalg.norm(corners, axis=2), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = adjugate @ np.linalg.inv(K) / volume[:, None, None]
    planes[np.abs(volume) <= DEGENERATE * lengths] = np.nan
    return planes


def _chunks(bounds: Int[np.ndarray, "m 4"]) -> Iterator[slice]:
    """Cut faces into runs whose bounding boxes stay under ``PIXELS_AT_ONCE`` pixels."""
    area = (bounds[:, 1] - bounds[:, 0] + 1) * (bounds[:, 3] - bounds[:, 2] + 1)
    total = np.concatenate([[0], np.cumsum(area)])
    start = 0
    while start < len(bounds):
        stop = int(np.searchsorted(total, total[start] + PIXELS_AT_ONCE, side="right")) - 1
        stop = max(stop, start + 1)
        yield slice(start, stop)
        start = stop


def _covered(
    plane: Float[np.ndarray, "m 3 3"],
    bounds: Int[np.ndarray, "m 4"],
    width: int,
    near: float,
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Return flat pixel, face (index into ``plane``) and 1 / depth of every covered pixel."""
    inverse_depth = plane.sum(axis=1)
    limits = np.concatenate([plane, -inverse_depth[:, None]], axis=1)  # (m, 4, 3): value >= 0
    limits[:, 3, 2] += 1.0 / near
    owner, row = expand_ranges(bounds[:, 2], bounds[:, 3])
    low = bounds[owner, 0] + 0.5
    high = bounds[owner, 1] + 0.5
    possible = np.ones(len(owner), bool)
    y = row + 0.5
    for i in range(4):
        slope = limits[owner, i, 0]
        rest = limits[owner, i, 1] * y + limits[owner, i, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -rest / slope
        low = np.where(slope > 0, np.maximum(low, crossing), low)
        high = np.where(slope < 0, np.minimum(high, crossing), high)
        possible &= (slope != 0) | (rest >= 0)
    first = np.ceil(low - 0.5).astype(np.int64)
    last = np.floor(high - 0.5).astype(np.int64)
    spans = np.flatnonzero(possible & (first <= last))
    which, column = expand_ranges(first[spans], last[spans])
    span = spans[which]
    face, line = owner[span], row[span]
    a, b, c = inverse_depth[face].T
    value = a * (column + 0.5) + b * (line + 0.5) + c
    good = value > 0
    return (line * width + column)[good], face[good], value[good]


def _resolve(
    nearest: Int[np.ndarray, " n"],
    vertices_camera: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
) -> MeshRaster:
    """Turn the winning (depth, face) keys into depth, face and barycentric pictures."""
    width, height = size
    seen = np.flatnonzero(nearest != np.iinfo(np.int64).max)
    depth = np.zeros(height * width, np.float32)
    face_index = np.full(height * width, -1, np.int32)
    barycentric = np.zeros((height * width, 3), np.float32)
    if len(seen):
        face = (nearest[seen] & 0xFFFFFFFF).astype(np.int64)
        plane = _ray_planes(np.asarray(vertices_camera, np.float64)[faces[face]], K)
        pixel = np.stack([seen % width + 0.5, seen // width + 0.5, np.ones(len(seen))], axis=1)
        weights = np.maximum(np.einsum("pij,pj->pi", plane, pixel), 0.0)
        total = weights.sum(axis=1)
        depth[seen] = 1.0 / total
        face_index[seen] = face
        barycentric[seen] = weights / total[:, None]
    return MeshRaster(
        depth.reshape(height, width),
        face_index.reshape(height, width),
        barycentric.reshape(height, width, 3),
    )
