"""Merge the depth maps into one coloured point per patch of surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from scipy.spatial import cKDTree
from torch import Tensor

from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.reconstruction.depth_consistency import DepthView, each_seen
from garden_models.reconstruction.planes import Planes
from garden_models.reconstruction.stereo_frame import StereoFrame, homogeneous_pixels
from garden_models.scene import PointCloud

NEIGHBOURS = 6
ISOLATED = 5.0  # a point this many footprints from its neighbours floats alone
MIN_FACING = 0.15  # cosine; below it a surface's own footprint says little


@dataclass(frozen=True)
class FusedView:
    """A photo's final depths, whose trust is their confidence, with its colours."""

    depth: DepthView
    rgb: UInt8[np.ndarray, "h w 3"]


def camera_normals(planes: Planes, frame: StereoFrame) -> Float[Tensor, "3 h w"]:
    """Return unit normals in the camera frame that face the camera."""
    height, width = frame.shape
    fx, fy = float(frame.K[0, 0]), float(frame.K[1, 1])
    x, y, _ = homogeneous_pixels(height, width, planes.w.device)
    across, down = planes.gx * fx, planes.gy * fy
    ray_x, ray_y = (x - float(frame.K[0, 2])) / fx, (y - float(frame.K[1, 2])) / fy
    # 1/z is linear over a plane: its coefficients are the normal over the plane's distance
    normal = torch.stack([across, down, planes.w - ray_x * across - ray_y * down])
    facing = normal[0] * ray_x + normal[1] * ray_y + normal[2]
    normal = torch.where(facing > 0, -normal, normal)
    return normal / normal.norm(dim=0).clamp(min=1e-12)


def footprints(planes: Planes, frame: StereoFrame) -> Float[Tensor, "h w"]:
    """Return the side of the surface patch that each pixel covers, in world units."""
    height, width = frame.shape
    x, y, _ = homogeneous_pixels(height, width, planes.w.device)
    fx, fy = float(frame.K[0, 0]), float(frame.K[1, 1])
    ray = torch.stack(
        [(x - float(frame.K[0, 2])) / fx, (y - float(frame.K[1, 2])) / fy, torch.ones_like(x)]
    )
    cosine = -(camera_normals(planes, frame) * ray / ray.norm(dim=0)).sum(dim=0)
    return 1 / (planes.w * (fx * fy) ** 0.5 * cosine.clamp(min=MIN_FACING).sqrt())


@torch.no_grad()
def owned_points(
    view: FusedView,
    footprint: Float[Tensor, "h w"],
    others: list[tuple[FusedView, Float[Tensor, "h w"], bool]],
    max_relative: float,
    max_pixels: float,
) -> PointCloud:
    """Return one view's points that no other view sees finer; ``spacing`` is their footprint.

    ``others`` are (view, footprints, wins ties). Colours are means over all views that agree.
    """
    frame, planes = view.depth.frame, view.depth.planes
    size = footprint.reshape(-1)
    confidence = view.depth.trust.reshape(-1)
    owned = (confidence > 0) & (planes.w.reshape(-1) > 0)
    weight = confidence + 1e-3
    colour = _colours(view.rgb, size.device) * weight
    depth_views = [other.depth for other, _, _ in others]
    for seen, (other, their_footprint, wins) in zip(
        each_seen(view.depth, depth_views, max_relative, max_pixels), others, strict=True
    ):
        their_size = their_footprint.reshape(-1)[seen.index]
        finer = their_size <= size if wins else their_size < size
        owned &= ~(seen.agrees & finer)
        say = (seen.trust + 1e-3) * seen.agrees
        colour += _colours(other.rgb, size.device)[:, seen.index] * say
        weight = weight + say
    keep = owned.cpu().numpy()
    colour = (colour / weight).T.cpu().numpy()[keep]
    xyz, normal = _lift(planes, frame, keep)
    return PointCloud(
        xyz=xyz.astype(np.float32),
        rgb=np.clip(np.round(colour), 0, 255).astype(np.uint8),
        normal=normal.astype(np.float32),
        spacing=size.cpu().numpy()[keep].astype(np.float32),
        confidence=confidence.clamp(0, 1).cpu().numpy()[keep].astype(np.float32),
    )


def _colours(rgb: UInt8[np.ndarray, "h w 3"], device: torch.device) -> Float[Tensor, "3 n"]:
    return torch.from_numpy(rgb.reshape(-1, 3).T.astype(np.float32)).to(device)


def _lift(
    planes: Planes, frame: StereoFrame, keep: Bool[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m 3"]]:
    """Return world points and normals of the kept pixels."""
    height, width = frame.shape
    pixels = homogeneous_pixels(height, width, planes.w.device).reshape(3, -1).cpu().numpy()
    depth = 1 / planes.w.reshape(-1).cpu().numpy()[keep].astype(np.float64)
    points = (np.linalg.inv(frame.K) @ pixels[:, keep] * depth).T
    world_from_camera = invert_rigid(frame.camera_from_world)
    normals = camera_normals(planes, frame).reshape(3, -1).cpu().numpy()[:, keep].T
    return transform_points(world_from_camera, points), normals @ world_from_camera[:3, :3].T


def merge_clouds(clouds: list[PointCloud], max_points: int) -> PointCloud:
    """Thin the views' points to one per cell of about their own footprint, drop what floats
    alone, and measure the spacing.

    Cells grow until at most ``max_points`` remain; near surfaces keep finer cells than far
    ones throughout.
    """
    cloud = PointCloud(
        *(
            np.concatenate([getattr(part, name) for part in clouds])
            for name in ("xyz", "rgb", "normal", "spacing", "confidence")
        )
    )
    factor = 1.0
    thinned = thin(cloud, factor)
    while len(thinned) > max_points:
        factor *= max(1.1, (len(thinned) / max_points) ** 0.5)
        thinned = thin(cloud, factor)
    return without_floaters(thinned, factor)


def thin(cloud: PointCloud, factor: float) -> PointCloud:
    """Average the points that share a cell of ``factor`` times their footprint (rounded to a
    power of two), weighted by confidence.
    """
    if len(cloud) == 0:
        return cloud
    level = np.round(np.log2(np.maximum(cloud.spacing * factor, 1e-12)))
    cell = np.floor(cloud.xyz / np.exp2(level)[:, None]).astype(np.int64)
    key = np.column_stack([level.astype(np.int64), cell])
    order = np.lexsort(key.T)
    fresh = np.any(np.diff(key[order], axis=0) != 0, axis=1)
    group = np.concatenate([[0], np.cumsum(fresh)])
    weight = (cloud.confidence[order] + 1e-3).astype(np.float64)
    normal = _group_mean(cloud.normal[order], weight, group)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    rgb = _group_mean(cloud.rgb[order], weight, group)
    return PointCloud(
        xyz=_group_mean(cloud.xyz[order], weight, group).astype(np.float32),
        rgb=np.clip(np.round(rgb), 0, 255).astype(np.uint8),
        normal=(normal / np.maximum(length, 1e-9)).astype(np.float32),
        spacing=_group_mean(cloud.spacing[order, None], weight, group)[:, 0].astype(np.float32),
        confidence=_group_mean(cloud.confidence[order, None], weight, group)[:, 0].astype(
            np.float32
        ),
    )


def _group_mean(
    values: Float[np.ndarray, "n c"],
    weight: Float[np.ndarray, " n"],
    group: Int[np.ndarray, " n"],
) -> Float[np.ndarray, "groups c"]:
    total = np.bincount(group, weight)
    columns = [np.bincount(group, weight * column) / total for column in values.T]
    return np.stack(columns, axis=1)


def without_floaters(cloud: PointCloud, factor: float) -> PointCloud:
    """Drop points far from all others, in units of their footprint; set ``spacing`` to
    the mean distance to the nearest neighbours.
    """
    if len(cloud) <= NEIGHBOURS:
        return cloud
    distance, _ = neighbour_distances(cloud.xyz, NEIGHBOURS)
    keep = distance[:, -1] < ISOLATED * max(factor, 1.0) * cloud.spacing
    kept = cloud.subset(keep)
    spacing = distance[keep, :4].mean(axis=1).astype(np.float32)
    return PointCloud(kept.xyz, kept.rgb, kept.normal, spacing, kept.confidence)


def neighbour_distances(
    points: Float[np.ndarray, "n 3"], count: int
) -> tuple[Float[np.ndarray, "n k"], Int[np.ndarray, "n k"]]:
    """Return the distances to and indices of each point's nearest others, nearest first."""
    distance, index = cKDTree(points).query(points, k=count + 1, workers=-1)
    return distance[:, 1:], index[:, 1:]
