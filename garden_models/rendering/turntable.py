"""Show a mesh from all sides, or a point cloud upright, for people to look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rigid import transform_points
from garden_models.geometry.rotation import normalized
from garden_models.rendering.config import Splatting
from garden_models.rendering.rasterise import interpolate, rasterise_mesh
from garden_models.rendering.splat import splat_points
from garden_models.scene import PointCloud

Picture = UInt8[np.ndarray, "h w 3"]


@dataclass(frozen=True)
class Turntable:
    """How an object or a cloud is looked at."""

    sides: int = 8
    elevation_deg: float = 20.0
    size: tuple[int, int] = (256, 256)
    field_of_view_deg: float = 30.0
    backdrop: tuple[int, int, int] = (240, 240, 240)
    shading: float = 0.35
    """Share of the brightness that falls with the slant to the viewer; 0: photos' colours
    alone. A little shows the shape where colour does not."""
    margin: float = 1.1
    """The picture's side relative to what is in it."""


def turn_mesh(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    vertex_rgb: UInt8[np.ndarray, "v 3"],
    config: Turntable = Turntable(),
) -> tuple[Picture, ...]:
    """Return the mesh (upright, y down) from ``sides`` sides, and from above as the last.

    All are drawn to one scale, at which the largest of them fills the picture; each is
    centred.
    """
    vertices = np.asarray(vertices, np.float64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    distance = config.margin * radius / np.sin(np.radians(config.field_of_view_deg) / 2)
    turns = [(360.0 * i / config.sides, config.elevation_deg) for i in range(config.sides)]
    sides = [
        transform_points(look_at(centre + distance * viewer_direction(*turn), centre), vertices)
        for turn in [*turns, (0.0, 89.9)]
    ]
    frames = [_fitted(in_camera, config) for in_camera in sides]
    zoom = min(K[0, 0] for K in frames)
    pictures = []
    for in_camera, fitted in zip(sides, frames, strict=True):
        K = _zoomed(fitted, zoom / fitted[0, 0], config)
        raster = rasterise_mesh(in_camera, faces, K, config.size, near=1e-3 * distance)
        rgb = interpolate(raster, faces, vertex_rgb)
        slant = _slant(in_camera, faces, raster.face_index, K)
        rgb *= (1 - config.shading + config.shading * slant)[..., None]
        pictures.append(_on_backdrop(rgb, raster.face_index >= 0, config))
    return tuple(pictures)


def view_cloud(
    points_gv: PointCloud,
    yaw_deg: float = 0.0,
    elevation_deg: float = 25.0,
    config: Turntable = Turntable(size=(640, 480), field_of_view_deg=45.0),
) -> Picture:
    """Return the cloud seen upright from a side, in perspective.

    ``yaw_deg`` 0 looks along +z of GV (as the reference photo does), 90 along +x. The view
    is fitted to the middle 96 % of the points on each axis, so that strays do not shrink it.
    """
    if not len(points_gv):
        return _on_backdrop(
            np.zeros((*config.size[::-1], 3)), np.zeros(config.size[::-1], bool), config
        )
    low, high = np.percentile(points_gv.xyz, [2, 98], axis=0)
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    distance = config.margin * radius / np.tan(np.radians(config.field_of_view_deg) / 2)
    camera = look_at(centre + distance * viewer_direction(yaw_deg, elevation_deg), centre)
    inner = ((points_gv.xyz >= low) & (points_gv.xyz <= high)).all(axis=1)
    splats = splat_points(
        points_gv,
        camera,
        _fitted(
            transform_points(camera, points_gv.xyz[inner] if inner.any() else points_gv.xyz), config
        ),
        config.size,
        Splatting(near=max(1e-3, 0.2 * (distance - radius))),
    )
    return _on_backdrop(splats.rgb, splats.depth > 0, config)


def _fitted(in_camera: Float[np.ndarray, "n 3"], config: Turntable) -> Float[np.ndarray, "3 3"]:
    """Return K, zoomed and shifted so that the points (in the camera's frame) fill the picture."""
    width, height = config.size
    K = _intrinsics(config)
    pixels = (in_camera / in_camera[:, 2:]) @ K[:2].T
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    extent = np.maximum(high - low, 1e-6)
    K[:2, 2] += np.array([width, height]) / 2 - (low + high) / 2
    return _zoomed(K, float(min(width / extent[0], height / extent[1])) / config.margin, config)


def _zoomed(
    K: Float[np.ndarray, "3 3"], zoom: float, config: Turntable
) -> Float[np.ndarray, "3 3"]:
    """Return K with everything ``zoom`` times as large about the middle of the picture."""
    width, height = config.size
    middle = np.array([[1.0, 0, width / 2], [0, 1.0, height / 2], [0, 0, 1.0]])
    return middle @ np.diag([zoom, zoom, 1.0]) @ np.linalg.inv(middle) @ K


def look_at(
    eye: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 4"]:
    """Return ``camera_from_gv`` of an upright camera (y down) at ``eye`` that sees ``target``."""
    z = normalized(target - eye)
    x = np.cross(np.array([0.0, 1.0, 0.0]), z)
    x = normalized(x) if np.linalg.norm(x) > 1e-9 else np.array([1.0, 0.0, 0.0])
    rotation = np.stack([x, np.cross(z, x), z])
    return np.concatenate([rotation, (-rotation @ eye)[:, None]], axis=1)


def viewer_direction(yaw_deg: float, elevation_deg: float) -> Float[np.ndarray, "3"]:
    """Return the unit vector from the centre to the viewer."""
    yaw, elevation = np.radians([yaw_deg, elevation_deg])
    flat = -np.array([np.sin(yaw), 0.0, np.cos(yaw)])
    return np.asarray(np.cos(elevation) * flat - np.sin(elevation) * np.array([0.0, 1.0, 0.0]))


def _intrinsics(config: Turntable) -> Float[np.ndarray, "3 3"]:
    """Return K for the field of view of the picture's shorter side."""
    width, height = config.size
    focal = min(width, height) / 2 / np.tan(np.radians(config.field_of_view_deg) / 2)
    return np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])


def _slant(
    vertices_camera: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    face_index: Int[np.ndarray, "h w"],
    K: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "h w"]:
    """Return the cosine between each seen face's normal and the ray to the viewer."""
    out = np.ones(face_index.shape)
    seen = face_index >= 0
    corners = vertices_camera[faces[face_index[seen]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rays = pixel_rays(pixel_grid(*face_index.shape), K)[seen]
    lengths = np.linalg.norm(normal, axis=1) * np.linalg.norm(rays, axis=1)
    out[seen] = np.abs(np.einsum("pi,pi->p", normal, rays)) / np.maximum(lengths, 1e-30)
    return out


def _on_backdrop(
    rgb: Float[np.ndarray, "h w 3"], seen: Bool[np.ndarray, "h w"], config: Turntable
) -> Picture:
    """Return the picture with the backdrop where nothing is seen."""
    out = np.where(seen[..., None], rgb, np.array(config.backdrop, float))
    return np.clip(np.rint(out), 0, 255).astype(np.uint8)
