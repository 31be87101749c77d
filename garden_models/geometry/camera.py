"""Project and unproject with pinhole cameras (OpenCV axes, pixel centres at +0.5).

``camera_from_world`` is 3x4 (or the top of a 4x4); depths are z-depths in the unit of the
world.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from garden_models.geometry.rigid import invert_rigid, transform_points


def project(
    points_world: Float[np.ndarray, "n 3"],
    K: Float[np.ndarray, "3 3"],
    camera_from_world: Float[np.ndarray, "r 4"],
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """Return pixel coordinates (x, y) and z-depth; pixels of points with z <= 0 are NaN."""
    points_camera = transform_points(camera_from_world, points_world)
    z = points_camera[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = (points_camera[:, :2] / z[:, None]) @ K[:2, :2].T + K[:2, 2]
    pixels[z <= 0] = np.nan
    return pixels, z


def pixel_grid(height: int, width: int) -> Float[np.ndarray, "h w 2"]:
    """Return the (x, y) coordinates of all pixel centres."""
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x + 0.5, y + 0.5], axis=-1).astype(np.float64)


def pixel_rays(
    pixels: Float[np.ndarray, "*b 2"], K: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "*b 3"]:
    """Return camera-frame rays with z = 1 through the pixels."""
    homogeneous = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
    return homogeneous @ np.linalg.inv(K).T


def backproject_depth(
    depth: Float[np.ndarray, "h w"],
    K: Float[np.ndarray, "3 3"],
    camera_from_world: Float[np.ndarray, "r 4"],
) -> Float[np.ndarray, "h w 3"]:
    """Lift a z-depth map to world points (meaningless where depth is 0)."""
    height, width = depth.shape
    points_camera = pixel_rays(pixel_grid(height, width), K) * depth[..., None]
    world_from_camera = invert_rigid(camera_from_world)
    flat = transform_points(world_from_camera, points_camera.reshape(-1, 3))
    return flat.reshape(height, width, 3)


def camera_centre(camera_from_world: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "3"]:
    """Return the camera's centre in the world."""
    return -camera_from_world[:3, :3].T @ camera_from_world[:3, 3]


def resize_intrinsics(
    K: Float[np.ndarray, "3 3"], old_size: tuple[int, int], new_size: tuple[int, int]
) -> Float[np.ndarray, "3 3"]:
    """Return ``K`` after the picture was resized from ``old_size`` to ``new_size`` (w, h)."""
    factor = np.diag([new_size[0] / old_size[0], new_size[1] / old_size[1], 1.0])
    return factor @ K


def inside_image(pixels: Float[np.ndarray, "n 2"], size: tuple[int, int]) -> Bool[np.ndarray, " n"]:
    """Tell which pixels lie in a picture of ``size`` = (width, height); NaN does not."""
    with np.errstate(invalid="ignore"):
        return (
            (pixels[:, 0] >= 0)
            & (pixels[:, 1] >= 0)
            & (pixels[:, 0] < size[0])
            & (pixels[:, 1] < size[1])
        )
