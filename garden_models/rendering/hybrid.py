"""Draw rigid meshes and the background's points into one picture, z-tested.

Colours are those of the photos, which carry their shading, so meshes are not lit again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int32, UInt8

from garden_models.geometry.rigid import homogeneous, invert_rigid, transform_points
from garden_models.rendering.config import Drawing
from garden_models.rendering.rasterise import interpolate, rasterise_mesh
from garden_models.rendering.splat import SplatRaster, splat_points
from garden_models.scene import Body, PointCloud

BACKGROUND_ID = -1


@dataclass(frozen=True)
class Picture:
    """A rendered view: colours, z-depth in metres (0: nothing), and which body each pixel
    shows (its index, ``BACKGROUND_ID`` elsewhere).
    """

    rgb: UInt8[np.ndarray, "h w 3"]
    depth: Float32[np.ndarray, "h w"]
    object_ids: Int32[np.ndarray, "h w"]


def render_scene(
    bodies: Sequence[Body],
    gv_from_body: Sequence[Float[np.ndarray, "4 4"]],
    background: PointCloud | SplatRaster,
    camera_from_gv: Float[np.ndarray, "r 4"],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
    config: Drawing = Drawing(),
) -> Picture:
    """Draw bodies at poses before a background.

    ``background`` may be points in GV or, to draw it once for several pictures of the same
    camera, what ``splat_points`` made of them. ``size`` is (width, height). Where a mesh and
    a point are nearer to each other than the points' spacing, the mesh is seen: a disc is
    that thick.
    """
    if isinstance(background, PointCloud):
        background = splat_points(background, camera_from_gv, K, size, config.splatting)
    neutral = np.array(config.neutral, np.float32)
    base = np.where(background.depth[..., None] > 0, background.rgb, neutral)
    picture = Picture(
        np.clip(np.rint(base), 0, 255).astype(np.uint8),
        background.depth.copy(),
        np.full(background.depth.shape, BACKGROUND_ID, np.int32),
    )
    meshes = [
        transform_points(homogeneous(camera_from_gv) @ pose, np.asarray(body.vertices, np.float64))
        for body, pose in zip(bodies, gv_from_body, strict=True)
    ]
    window = _window(meshes, K, size)
    if window is None:
        return picture
    fine, (rows, columns) = config.smoothing, window
    fine_K = np.diag([fine, fine, 1.0]) @ _shifted(K, columns.start, rows.start)
    fine_size = (columns.stop - columns.start) * fine, (rows.stop - rows.start) * fine
    behind = background.depth[window] + background.thickness[window]
    limit = np.where(background.depth[window] > 0, behind, np.inf)
    limit = np.repeat(np.repeat(limit, fine, axis=0), fine, axis=1)
    depth = np.full(limit.shape, np.inf)
    ids = np.full(limit.shape, BACKGROUND_ID, np.int32)
    colour = np.zeros((*limit.shape, 3), np.float32)
    for index, (body, vertices) in enumerate(zip(bodies, meshes, strict=True)):
        raster = rasterise_mesh(vertices, body.faces, fine_K, fine_size)
        front = (raster.depth > 0) & (raster.depth < np.minimum(depth, limit))
        depth[front], ids[front] = raster.depth[front], index
        colour[front] = interpolate(raster, body.faces, body.vertex_rgb)[front]
    _lay_over(picture, window, base[window], _MeshLayer(depth, ids, colour), fine)
    return picture


def world_camera(
    camera_from_world: Float[np.ndarray, "r 4"], gv_from_world: Float[np.ndarray, "4 4"]
) -> Float[np.ndarray, "4 4"]:
    """Return ``camera_from_gv`` of a camera that is known in the world."""
    return homogeneous(camera_from_world) @ invert_rigid(gv_from_world)


@dataclass(frozen=True)
class _MeshLayer:
    """Meshes drawn finer than the picture: depth (inf: none), body indices and colours."""

    depth: Float[np.ndarray, "fh fw"]
    ids: Int32[np.ndarray, "fh fw"]
    rgb: Float32[np.ndarray, "fh fw 3"]


def _window(
    meshes: Sequence[Float[np.ndarray, "v 3"]],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
) -> tuple[slice, slice] | None:
    """Return the rows and columns that the meshes may cover; None if they are not in view."""
    width, height = size
    points = np.concatenate(meshes) if meshes else np.zeros((0, 3))
    if not (points[:, 2] > 0).any():
        return None
    if (points[:, 2] <= 0).any():
        return slice(0, height), slice(0, width)
    pixels = (points / points[:, 2:]) @ K[:2].T
    low = np.clip(np.floor(pixels.min(axis=0)), 0, [width, height]).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)), 0, [width, height]).astype(int)
    if (high <= low).any():
        return None
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _shifted(K: Float[np.ndarray, "3 3"], column: int, row: int) -> Float[np.ndarray, "3 3"]:
    """Return the intrinsics of the part of a picture that begins at (column, row)."""
    shifted = K.copy()
    shifted[:2, 2] -= (column, row)
    return shifted


def _lay_over(
    picture: Picture,
    window: tuple[slice, slice],
    base: Float32[np.ndarray, "h w 3"],
    layer: _MeshLayer,
    fine: int,
) -> None:
    """Average the finer mesh layer over the picture's pixels, in place."""
    height, width, _ = base.shape
    cells = (height, fine, width, fine)
    is_mesh = layer.ids.reshape(cells) >= 0
    cover = is_mesh.mean(axis=(1, 3), dtype=np.float32)
    rgb = layer.rgb.reshape(*cells, 3).mean(axis=(1, 3)) + (1 - cover[..., None]) * base
    picture.rgb[window] = np.clip(np.rint(rgb), 0, 255).astype(np.uint8)
    # A pixel belongs to what covers most of it; of several bodies, to the nearest one.
    fine_depth = np.moveaxis(layer.depth.reshape(cells), 1, 2).reshape(height, width, fine * fine)
    fine_ids = np.moveaxis(layer.ids.reshape(cells), 1, 2).reshape(height, width, fine * fine)
    nearest = fine_depth.argmin(axis=2)[..., None]
    is_body = cover >= 0.5
    body_depth = np.take_along_axis(fine_depth, nearest, axis=2)[..., 0]
    picture.depth[window] = np.where(is_body, body_depth, picture.depth[window])
    picture.object_ids[window] = np.where(
        is_body, np.take_along_axis(fine_ids, nearest, axis=2)[..., 0], BACKGROUND_ID
    )
