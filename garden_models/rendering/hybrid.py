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
    behind = background.depth + background.thickness
    fine = config.smoothing
    width, height = size
    limit = np.where(background.depth > 0, behind, np.inf)
    limit = np.kron(limit, np.ones((fine, fine)))
    fine_K = np.diag([fine, fine, 1.0]) @ K
    depth = np.full(limit.shape, np.inf)
    ids = np.full(limit.shape, BACKGROUND_ID, np.int32)
    colour = np.zeros((*limit.shape, 3), np.float32)
    for index, (body, pose) in enumerate(zip(bodies, gv_from_body, strict=True)):
        camera_from_body = homogeneous(camera_from_gv) @ pose
        vertices = transform_points(camera_from_body, np.asarray(body.vertices, np.float64))
        raster = rasterise_mesh(vertices, body.faces, fine_K, (width * fine, height * fine))
        front = (raster.depth > 0) & (raster.depth < np.minimum(depth, limit))
        depth[front], ids[front] = raster.depth[front], index
        colour[front] = interpolate(raster, body.faces, body.vertex_rgb)[front]
    return _flatten(background, depth, ids, colour, config)


def world_camera(
    camera_from_world: Float[np.ndarray, "r 4"], gv_from_world: Float[np.ndarray, "4 4"]
) -> Float[np.ndarray, "4 4"]:
    """Return ``camera_from_gv`` of a camera that is known in the world."""
    return homogeneous(camera_from_world) @ invert_rigid(gv_from_world)


def _flatten(
    background: SplatRaster,
    depth: Float[np.ndarray, "fh fw"],
    ids: Int32[np.ndarray, "fh fw"],
    colour: Float32[np.ndarray, "fh fw 3"],
    config: Drawing,
) -> Picture:
    """Average the finer mesh layer over the background's pixels."""
    height, width = background.depth.shape
    fine = config.smoothing
    cells = (height, fine, width, fine)
    is_mesh = ids.reshape(cells) >= 0
    cover = is_mesh.mean(axis=(1, 3), dtype=np.float32)[..., None]
    mesh_rgb = colour.reshape(*cells, 3).mean(axis=(1, 3))
    seen = background.depth > 0
    base = np.where(seen[..., None], background.rgb, np.array(config.neutral, np.float32))
    rgb = mesh_rgb + (1 - cover) * base
    # A pixel belongs to what covers most of it; of several bodies, to the nearest one.
    fine_depth = np.moveaxis(depth.reshape(cells), 1, 2).reshape(height, width, fine * fine)
    fine_ids = np.moveaxis(ids.reshape(cells), 1, 2).reshape(height, width, fine * fine)
    nearest = fine_depth.argmin(axis=2)[..., None]
    body = np.take_along_axis(fine_ids, nearest, axis=2)[..., 0]
    body_depth = np.take_along_axis(fine_depth, nearest, axis=2)[..., 0]
    is_body = cover[..., 0] >= 0.5
    return Picture(
        np.clip(np.rint(rgb), 0, 255).astype(np.uint8),
        np.where(is_body, body_depth, background.depth).astype(np.float32),
        np.where(is_body, body, BACKGROUND_ID).astype(np.int32),
    )
