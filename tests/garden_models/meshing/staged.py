"""Stage ray-cast scenes with exact truth: meshes on a table seen by known cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from garden_models.geometry.camera import backproject_depth, pixel_grid, pixel_rays
from garden_models.geometry.rigid import invert_rigid, rigid
from garden_models.geometry.rotation import axis_angle
from garden_models.meshing.ray_casting import RayCaster
from garden_models.scene import (
    GravityView,
    ObjectMasks,
    PointCloud,
    Reconstruction,
    Scale,
    SupportSurface,
    Target,
    View,
)

SIZE = (240, 180)
FOCAL = 230.0
SUPPORT = 0.6


@dataclass(frozen=True)
class Staged:
    """A staged capture of ``truth`` (GV) and its perfect masks."""

    reconstruction: Reconstruction
    gravity_view: GravityView
    masks: ObjectMasks
    truth: trimesh.Trimesh


def standing(mesh: trimesh.Trimesh, x: float = 0.0, z: float = 0.0) -> trimesh.Trimesh:
    """Return the mesh moved so that it stands on the support at (x, z), y down."""
    out = mesh.copy()
    low, high = out.bounds
    middle = 0.5 * (low + high)
    out.apply_translation([x - middle[0], SUPPORT - high[1], z - middle[2]])
    return out


def colour_of(points: np.ndarray) -> np.ndarray:
    """Return a colour that differs everywhere (uint8), of points in GV."""
    phase = points @ np.array([[31.0, 17.0, 5.0], [11.0, 37.0, 19.0], [7.0, 13.0, 41.0]])
    return np.clip(127.5 + 110.0 * np.sin(phase), 0, 255).astype(np.uint8)


def orbit(count: int, arc_deg: float, elevation_deg: float, radius: float) -> list[np.ndarray]:
    """Return ``camera_from_gv`` (3x4) on an arc that looks at the support's origin."""
    out = []
    spread = np.radians(arc_deg) * (np.arange(count) / max(count - (arc_deg < 360), 1) - 0.5)
    for i, azimuth in enumerate(spread):
        elevation = np.radians(elevation_deg + 12.0 * (-1) ** i)
        direction = np.array(
            [
                np.cos(elevation) * np.sin(azimuth),
                -np.sin(elevation),
                -np.cos(elevation) * np.cos(azimuth),
            ]
        )
        eye = np.array([0.0, SUPPORT - 0.08, 0.0]) + radius * direction
        z = -direction
        x = np.cross(np.array([0.0, 1.0, 0.0]), z)
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(z, x), z])
        out.append(rigid(rotation, -rotation @ eye)[:3])
    return out


def stage(
    objects: list[trimesh.Trimesh],
    cameras: list[np.ndarray],
    *,
    noise: float = 0.002,
    holes: float = 0.2,
    seed: int = 0,
    support: bool = True,
) -> Staged:
    """Photograph ``objects[0]`` (others may hide it); ``noise`` is relative to depth."""
    rng = np.random.default_rng(seed)
    table = trimesh.creation.box([4.0, 0.02, 4.0])
    table.apply_translation([0.0, SUPPORT + 0.01, 0.0])
    scene = trimesh.util.concatenate([*objects, table])
    owner = np.repeat(np.arange(len(objects) + 1), [len(m.faces) for m in [*objects, table]])
    caster = RayCaster(scene.vertices, scene.faces)
    K = np.array([[FOCAL, 0, SIZE[0] / 2], [0, FOCAL, SIZE[1] / 2], [0, 0, 1.0]])
    rays = pixel_rays(pixel_grid(SIZE[1], SIZE[0]), K).reshape(-1, 3)
    world_from_gv = rigid(axis_angle(np.array([1.0, 2.0, -1.0]), 0.7), np.array([0.4, -1.0, 2.0]))
    gv_from_world = invert_rigid(world_from_gv)
    views, masks, points = [], [], []
    for i, camera_from_gv in enumerate(cameras):
        gv_from_camera = invert_rigid(camera_from_gv)
        hits = caster.cast(
            np.tile(gv_from_camera[:3, 3], (len(rays), 1)), rays @ gv_from_camera[:3, :3].T
        )
        hit = hits.face >= 0
        exact = np.where(hit, hits.distance, 0.0)
        mask = (hit & (owner[hits.face] == 0)).reshape(SIZE[1], SIZE[0])
        places = gv_from_camera[:3, 3] + (rays * exact[:, None]) @ gv_from_camera[:3, :3].T
        rgb = np.where(hit[:, None], colour_of(places), 90).astype(np.uint8)
        depth = exact * (1.0 + noise * rng.normal(size=len(exact)))
        depth[rng.random(len(depth)) < holes] = 0.0
        depth = depth.reshape(SIZE[1], SIZE[0]).astype(np.float32)
        camera_from_world = (np.vstack([camera_from_gv, [0, 0, 0, 1]]) @ gv_from_world)[:3]
        views.append(
            View(
                photo=f"{i:02d}.png",
                rgb=rgb.reshape(SIZE[1], SIZE[0], 3),
                depth=depth,
                confidence=(depth > 0).astype(np.float32),
                K=K,
                camera_from_world=camera_from_world,
                original_size=SIZE,
            )
        )
        masks.append(mask)
        keep = mask & (depth > 0) & (rng.random(mask.shape) < 0.2)
        points.append(backproject_depth(depth, K, camera_from_gv)[keep])
    points_gv = np.concatenate(points)
    cloud = PointCloud(
        points_gv.astype(np.float32),
        colour_of(points_gv),
        np.tile(np.array([0, -1, 0], np.float32), (len(points_gv), 1)),
        np.full(len(points_gv), 0.005, np.float32),
        np.ones(len(points_gv), np.float32),
    )
    outline = np.array([[-2, -2], [2, -2], [2, 2], [-2, 2]], float)
    surface = SupportSurface("table", "table", SUPPORT, outline, 16.0, 1000) if support else None
    gravity_view = GravityView(gv_from_world, views[0].photo, world_from_gv[:3, 1], 0.1, ())
    empty = np.zeros((0, 3), np.float32)
    nothing = PointCloud(empty, empty.astype(np.uint8), empty, empty[:, 0], empty[:, 0])
    return Staged(
        Reconstruction(tuple(views), nothing, empty, (), Scale("known_cameras")),
        gravity_view,
        ObjectMasks(
            Target("thing", views[0].photo, (0, 0, *SIZE)),
            tuple(v.photo for v in views),
            tuple(masks),
            np.zeros(len(views)),
            cloud,
            surface,
        ),
        objects[0],
    )


def block() -> trimesh.Trimesh:
    """Return an L-shaped block with a knob: 0.26 x 0.175 x 0.12 m, no mirror plane, turned."""
    x = np.array([-0.13, -0.04, 0.055, 0.105, 0.13])
    y = np.array([-0.14, -0.075, -0.035, 0.035])
    z = np.array([-0.06, 0.01, 0.05, 0.06])
    solid = np.zeros((4, 3, 3), bool)
    solid[:, 2] = True
    solid[0] = True
    solid[2, 1, 1] = True
    out = _solid_of_cells(x, y, z, solid)
    out.apply_transform(trimesh.transformations.rotation_matrix(0.5, [0, 1, 0]))
    return out


def _solid_of_cells(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, solid: np.ndarray
) -> trimesh.Trimesh:
    """Return the closed surface of the solid cells of a grid with lines x, y, z."""
    lines = (x, y, z)
    parts = []
    for cell in np.argwhere(solid):
        low = np.array([line[i] for line, i in zip(lines, cell, strict=True)])
        high = np.array([line[i + 1] for line, i in zip(lines, cell, strict=True)])
        box = trimesh.creation.box(bounds=np.stack([low, high]))
        beyond = cell + np.rint(box.face_normals).astype(int)
        inside = ((beyond >= 0) & (beyond < solid.shape)).all(axis=1)
        covered = inside & solid[tuple(np.clip(beyond, 0, np.array(solid.shape) - 1).T)]
        box.update_faces(~covered)
        parts.append(box)
    return trimesh.util.concatenate(parts)
